// Sweeps: volume and area while one parameter goes through its trained range and the others stay where the sliders are.
const SWEEP_STEPS = 17;

// A small plot: values against a parameter, the place of the slider as a dot. kind: volume or area.
function sweepPlot(p, values, kind, unit, now) {
  const width = 250, height = 120, left = 44, right = 10, top = 10, bottom = 24;
  const known = values.filter(Number.isFinite), least = Math.min(...known), most = Math.max(...known);
  // an axis of at least a twentieth of the value: errors of the network do not look like changes
  const extra = Math.max(0.05 * most - (most - least), 0) / 2, low = least - extra, high = most + extra, span = high - low || 1;
  const x = v => left + (v - p.min) / (p.max - p.min) * (width - left - right);
  const y = v => height - bottom - (v - low) / span * (height - top - bottom);
  const at = k => p.min + k / (values.length - 1) * (p.max - p.min);
  const picture = svg('svg', { viewBox: `0 0 ${width} ${height}`, role: 'img', 'aria-label': `${kind} against ${p.name}: from ${numberText(values[0])} to ${numberText(values.at(-1))} ${unit}` });
  for (const v of [low, high]) {
    picture.append(svg('line', { class: 'grid', x1: left, x2: width - right, y1: y(v), y2: y(v) }),
      svg('text', { x: left - 6, y: y(v) + 4, 'text-anchor': 'end' }, numberText(v)));
  }
  picture.append(svg('text', { x: left, y: height - 6 }, numberText(p.min)), svg('text', { x: width - right, y: height - 6, 'text-anchor': 'end' }, withUnit(p.max, p.unit)),
    svg('polyline', { class: 'heldout', points: values.map((v, k) => (Number.isFinite(v) ? `${x(at(k)).toFixed(1)},${y(v).toFixed(1)}` : '')).join(' ') }));
  if (now >= p.min && now <= p.max) {
    const place = (now - p.min) / (p.max - p.min) * (values.length - 1), k = Math.min(Math.floor(place), values.length - 2), share = place - k;
    picture.append(svg('circle', { class: 'end', cx: x(now), cy: y(values[k] + share * (values[k + 1] - values[k])), r: 3.5 }));
  }
  return element('figure', {}, picture, element('figcaption', {}, kind, element('small', {}, ' ' + unit)));
}

// sweeps: [parameter][step] = [volume, area] at `parameters`.
function showSweeps(sweeps, at) {
  $('sweeps-section').hidden = false;
  $('sweeps').replaceChildren(...parameters.map((p, i) => element('div', { class: 'sweep' }, element('h3', {}, p.name),
    sweepPlot(p, sweeps[i].map(v => v[0]), 'Volume', 'mm³', at[i]), sweepPlot(p, sweeps[i].map(v => v[1]), 'Area', 'mm²', at[i]))));
}
