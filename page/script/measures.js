// Tiles with a number each; the measures of the shape, such as lengths, which follow the sliders where the page knows the shape.

// A tile of `title`: {tile, set(value, unit, note)}.
function createReading(title) {
  const value = element('b'), unit = element('small'), note = element('span');
  const set = (...texts) => [value, unit, note].forEach((part, i) => setText(part, (i === 1 && texts[1] ? ' ' : '') + (texts[i] ?? '')));
  return { tile: element('div', {}, element('dt', {}, title), element('dd', {}, value, unit, note)), set };
}

// Those that the surface of the map has, volume and extent, are not repeated.
const ownMeasures = (figures.measures ?? []).filter(m => !m.of_mesh).map(m => {
  const reading = createReading(m.name.replaceAll('_', ' '));
  reading.tile.title = m.help;
  return { ...m, reading };
});

// Shows the measures at the sliders; values null: those in the figures, at the default or at the fitted parameters.
function showMeasures(values, depth) {
  const fixed = figures.live ? '; they do not follow the sliders: this page cannot run the code of the shape' : '';
  setText($('measures-note'), values ? 'of the shape at the sliders' : (fit ? 'of the fitted shape' : 'at the default parameters') + fixed);
  ownMeasures.forEach((m, i) => {
    const value = values ? values[i] : m.value, known = Number.isFinite(value);
    m.reading.set(known ? numberText(value, 5) : '–', known ? m.unit : '', !m.of_depth ? (values || !figures.live ? '' : fit ? 'fitted shape' : 'default shape') : !values ? 'of a depth' : known ? `at ${numberText(depth)} mm` : 'beyond the end');
  });
}

// deepened(depth) is called when the reader asks for another depth (mm).
function startMeasures(depth, deepened) {
  if (!ownMeasures.length) return;
  $('measures-section').hidden = false;
  $('measures').append(...ownMeasures.map(m => m.reading.tile));
  showMeasures(null, depth);
  const input = element('input', { type: 'number', min: 0, step: 'any', value: depth, 'aria-label': 'Depth, mm' });
  input.addEventListener('input', () => { if (input.valueAsNumber >= 0) deepened(input.valueAsNumber); });
  if (figures.live && ownMeasures.some(m => m.of_depth)) $('depth').append('depth ', input, ' mm');
}
