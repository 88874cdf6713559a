// A page of a fit: the image with the contour of the fit and the band of one standard deviation, the estimates, and the verdict.
const fit = figures.fit ? readFit() : null;

// The map, the standard deviation and the image on the grid of the model, in the frame of the shape (see cli/page/page_fit.h).
function readFit() {
  const { map_step_mm: mapStep, sd_step_mm: sdStep, image } = figures.fit_data, { size } = figures.grid, bytes = bytesOf('fit');
  const count = size[0] * size[1] * size[2], values = figures.parameters.map(p => figures.fit.parameters[p.name]);
  const made = { map: Float32Array.from(new Int16Array(bytes.buffer, 0, count), v => v * mapStep), values, sd: null, image: null };
  let at = 2 * count;
  if (sdStep > 0) {
    made.sd = Float32Array.from(bytes.subarray(at, at + count), v => v * sdStep);
    at += count;
  }
  if (image) made.image = { values: bytes.subarray(at), size: image.size };
  return made;
}

// Slices of a volume that lies on the grid, or on one with voxels half as long, as Float32Array [height][width] of an image.
function stretched(volume, volumeSize, axis, index, width, height, flipped) {
  const { size } = figures.grid, fine = a => (size[a] > 1 ? (volumeSize[a] - 1) / (size[a] - 1) : 1), [right, up] = SIDES[axis];
  const { data, width: columns, height: rows } = sliceOf(volume, volumeSize, axis, Math.round(index * fine(axis)));
  const across = pixelPlaces(width, size[right], false, fine(right)), down = pixelPlaces(height, size[up], flipped, fine(up));
  const out = new Float32Array(width * height), next = columns > 1 ? 1 : 0;
  for (let y = 0; y < height; y++) {
    const low = down.low[y] * columns, high = rows > 1 ? low + columns : low, part = down.share[y];
    for (let x = 0; x < width; x++) {
      const a = across.low[x], share = across.share[x];
      const upper = data[low + a] + share * (data[low + a + next] - data[low + a]);
      const lower = data[high + a] + share * (data[high + a + next] - data[high + a]);
      out[y * width + x] = upper + part * (lower - upper);
    }
  }
  return out;
}

const fitColours = colours('band', 'inside', 'near');

// The picture behind the contours in the slice across an axis: the image, or the inside of the fit, and the band. pixel: mm.
function paintFit(axis, index, width, height, flipped, pixel) {
  const picture = new ImageData(width, height), { data } = picture, { band, inside, near } = fitColours();
  const of = (volume, size) => volume && stretched(volume, size, axis, index, width, height, flipped);
  const d = of(fit.map, figures.grid.size), sd = of(fit.sd, figures.grid.size), grey = fit.image && of(fit.image.values, fit.image.size);
  for (let i = 0; i < d.length; i++) {
    const covered = sd ? 0.5 * Math.min(Math.max((sd[i] - Math.abs(d[i])) / pixel + 0.5, 0), 1) : 0;
    for (let c = 0; c < 3; c++) {
      const plain = grey ? grey[i] / 255 : (d[i] < 0 ? inside : near)[c];
      data[4 * i + c] = Math.round(255 * (plain + covered * (band[c] - plain)));
    }
    data[4 * i + 3] = 255;
  }
  return picture;
}

const withSd = (value, sd, unit) => withUnit(value, '', 4) + (sd > 0 ? ' ± ' + numberText(sd, 2) : '') + (unit ? '\u00a0' + unit : '');

// What the reader sees below the slider of a parameter.
function fittedText(p) {
  const { parameters: values, parameters_sd: sds, not_determined: open = [], at_bound: bound = [] } = figures.fit;
  const extra = open.includes(p.name) ? ', not determined by the data' : bound.includes(p.name) ? ', at the end of its range' : '';
  return `fitted ${withSd(values[p.name], sds?.[p.name], p.unit)}${extra}`;
}

// The correlations of the unknowns as squares: full colour is 1 or -1.
function correlationPicture(names, rows) {
  const n = names.length, cell = 22, left = 8 + 7.2 * Math.max(...names.map(name => name.length)), top = 16, width = left + n * cell + 4;
  const height = top + n * cell + left;
  const picture = svg('svg', { viewBox: `0 0 ${width} ${height}`, width, height, role: 'img', 'aria-label': 'Correlations of the unknowns' });
  names.forEach((name, i) => {
    const x = left + (i + 0.5) * cell, y = top + n * cell + 8;
    picture.append(svg('text', { x: left - 6, y: top + (i + 0.5) * cell + 4, 'text-anchor': 'end' }, name),
      svg('text', { transform: `translate(${x + 4} ${y}) rotate(-90)`, 'text-anchor': 'end' }, name));
    rows[i].forEach((r, k) => {
      const known = typeof r === 'number', square = svg('rect', {
        x: left + k * cell + 1, y: top + i * cell + 1, width: cell - 2, height: cell - 2, rx: 3,
        class: !known ? 'unknown' : r < 0 ? 'negative' : 'positive', 'fill-opacity': known ? Math.min(Math.abs(r), 1) : 0
      });
      square.append(svg('title', {}, `${name}, ${names[k]}: ${known ? r.toFixed(2) : 'unknown'}`));
      picture.append(square);
    });
  });
  return picture;
}

function showVerdict() {
  const { verdict, trusted, doubt, not_determined: open = [], not_determined_motions: motions } = figures.fit;
  const grade = verdict?.grade ?? (trusted === false ? 'failed' : 'passed');
  $('verdict').append(element('p', { class: 'grade ' + grade }, trusted === false ? 'not to be trusted' : grade));
  if (doubt) $('verdict').append(element('p', {}, doubt));
  const list = element('ul', { class: 'checks' });
  for (const { name, grade: of, figure, limit, text } of verdict?.checks ?? []) {
    const numbers = typeof figure === 'number' ? numberText(figure) + (typeof limit === 'number' ? `, limit ${numberText(limit)}` : '') : '';
    list.append(element('li', { class: of }, element('b', {}, name), ` ${of} `, element('small', {}, numbers), text ? element('span', {}, text) : ''));
  }
  $('verdict').append(list);
  const missing = [...open, ...(motions ? [motions] : [])];
  $('verdict').append(element('p', { class: missing.length ? 'missing' : 'soft' },
    missing.length ? 'The data do not determine: ' + missing.join(', ') + '.' : 'The data determine all parameters and the pose.'));
}

function showEstimates() {
  const { pose, overlap, image, kind, measures = [] } = figures.fit, degrees = 180 / Math.PI;
  const triple = (values, sds, factor, unit) => values.map(v => numberText(v * factor, 3)).join(', ') +
    (sds?.every(sd => sd > 0) ? ' ± ' + sds.map(sd => numberText(sd * factor, 2)).join(', ') : '') + '\u00a0' + unit;
  fillTable($('estimates'), [
    [kind === 'image' ? 'Image' : kind === 'labels' ? 'Labels' : 'Points', String(image).split('/').pop()],
    ...parameters.map(p => [p.name, withSd(figures.fit.parameters[p.name], figures.fit.parameters_sd?.[p.name], p.unit)]),
    ['Rotation about x, y, z', triple(pose.rotation_rad, pose.rotation_sd_rad, degrees, '°')],
    ['Translation', triple(pose.translation_mm, pose.translation_sd_mm, 1, 'mm')],
    ...measures.map(m => [m.name, withSd(m.value, m.sd, m.unit)]),
    ...(overlap ? [['Dice', numberText(overlap.dice, 4)]] : [])
  ]);
}

function showFit() {
  $('fit-section').hidden = false;
  $('slices-title').replaceChildren('Slices ', element('small', {}, fit.image ? 'image, in the frame of the shape' : 'in the frame of the shape'));
  const key = (style, text) => element('span', { class: 'key ' + style }, text);
  $('slices-key').hidden = false;
  $('slices-key').append(key('fitted', 'fit'), ...(fit.sd ? [key('band', 'one standard deviation')] : []), ...(figures.live ? [key('moved', 'shape of the sliders')] : []));
  showVerdict();
  showEstimates();
  if (figures.fit.correlation && figures.fit.unknowns) $('correlations').append(correlationPicture(figures.fit.unknowns, figures.fit.correlation));
}
