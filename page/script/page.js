// The page: sliders, the worker that computes maps, the views, and the readings.
const { parameters } = figures;
const grid = { ...figures.grid, straight: figures.grid.direction.every((v, i) => Math.abs(v - (i % 4 === 0)) < 1e-9) };
const box = figures.at_default;

// The position of a voxel (continuous indices) in mm.
function worldOf(index) {
  const { origin, direction, spacing } = grid;
  return [0, 1, 2].map(row => origin[row] + [0, 1, 2].reduce((sum, axis) => sum + direction[3 * row + axis] * spacing[axis] * index[axis], 0));
}

const middle = grid.size.map(n => (n - 1) / 2);
const centre = box.triangles ? box.min.map((low, a) => (low + box.max[a]) / 2) : worldOf(middle);
const radius = box.triangles ? 0.5 * Math.hypot(...box.min.map((low, a) => box.max[a] - low)) : Math.hypot(...grid.size.map((n, a) => n * grid.spacing[a])) / 2;
// distances of the last colours: half of the shortest edge of the grid
const reach = Math.min(...grid.size.map((n, a) => n * grid.spacing[a])) / 3;

// where the sliders begin
const home = fit ? fit.values : parameters.map(p => p.default);

const state = {
  values: [...home],
  position: [...box.slices],
  ranges: parameters.map(p => [p.min, p.max]),
  depth: 10, map: null, compared: null, ofMesh: null, watched: null, framed: false,
  knowsShape: false, busy: true, wanted: false, drawn: 0, waiting: []
};

function notice(text) {
  $('notice').textContent = text;
  $('notice').hidden = !text;
}

// views

const surfaceView = createSurfaceView($('surface'), centre, radius);
if (!surfaceView) {
  document.querySelector('.view').classList.add('without');
  $('source').textContent = 'This browser has no WebGL2: the slices show the shape.';
}

const still = figures.live ? null : readStill();
const movable = figures.live || fit;
const sliceViews = AXES.map((_, axis) => createSliceView(axis, grid, {
  backdrop: fit && paintFit,
  moved: movable && ((a, index) => moveSlices(AXES.map((__, b) => (b === a ? index : null)))),
  pointed: moveSlices,
  watched: a => {
    state.watched = a;
    showFrame();
  }
}));
$('slices').append(...sliceViews.map(view => view.figure));

function moveSlices(position) {
  position.forEach((index, axis) => { if (index !== null) state.position[axis] = index; });
  drawSlices();
}

function drawSlices() {
  if (fit) showFitSlices();
  else if (still) still.slices.forEach((slice, axis) => sliceViews[axis].show(slice, box.slices, reach));
  else if (state.map) sliceViews.forEach((view, axis) => view.show(sliceOf(state.map.values, grid.size, axis, state.position[axis]), state.position, reach));
  showFrame();
}

// The contour of the fit, and that of the sliders where they have moved.
function showFitSlices() {
  const moved = state.map && state.map.parameters.some((v, i) => v !== home[i]);
  sliceViews.forEach((view, axis) => {
    const of = values => sliceOf(values, grid.size, axis, state.position[axis]), fitted = of(fit.map);
    view.show(moved ? of(state.map.values) : fitted, state.position, reach, fitted);
  });
}

// Shows in the view of the surface where the slice lies that the reader looks at.
function showFrame() {
  const axis = state.watched;
  if (!surfaceView || (axis === null && !state.framed)) return;
  state.framed = axis !== null;
  surfaceView.showFrames(axis === null ? [] : [[0, 0], [1, 0], [1, 1], [0, 1]].map(([a, b]) => {
    const index = [...state.position], [right, up] = [[1, 2], [0, 2], [0, 1]][axis];
    index[right] = a * (grid.size[right] - 1);
    index[up] = b * (grid.size[up] - 1);
    return worldOf(index);
  }));
}

// The pictures of a page without a model (see cli/page/page.h).
function readStill() {
  const bytes = bytesOf('still');
  let at = 0;
  const take = (Type, n) => {
    const part = new Type(bytes.buffer, at, n);
    at += part.byteLength;
    return part;
  };
  const [nx, ny, nz] = grid.size;
  const slices = [[ny, nz], [nx, nz], [nx, ny]].map(([width, height]) => ({ data: take(Float32Array, width * height), width, height }));
  const triangles = Uint32Array.from(take(box.vertices > 65536 ? Uint32Array : Uint16Array, 3 * box.triangles));
  const positions = Float32Array.from(take(Uint16Array, 3 * box.vertices), (v, i) => box.min[i % 3] + v / 65535 * (box.max[i % 3] - box.min[i % 3]));
  return { slices, triangles, vertices: withNormals(positions, triangles) };
}

// readings

const readings = {};
for (const [key, title] of [['volume', 'Volume'], ['area', 'Surface area'], ['size', 'Extent'], ['time', 'Map computed in'], ['error', 'Error of the network']]) {
  readings[key] = createReading(title);
  $('readings').append(readings[key].tile);
}

const setReading = (key, ...texts) => readings[key].set(...texts);

function showReadings({ volume, area, box: corners, cut, mapTime, exact }) {
  const text = n => numberText(n, 4), here = found => (found && found.parameters.every((v, i) => v === state.values[i]) ? found : null);
  const mesh = here(state.ofMesh)?.values, ofMesh = texts => (mesh ? `of the mesh ${texts.join(' × ')}` : '');
  setReading('volume', corners[0] <= corners[3] ? text(volume) : 'none', 'mm³', cut ? 'cut off by the grid' : ofMesh([mesh && text(mesh[0])]));
  setReading('area', text(area), 'mm²', ofMesh([mesh && text(mesh[1])]));
  setReading('size', corners[0] <= corners[3] ? [0, 1, 2].map(a => numberText(corners[3 + a] - corners[a])).join(' × ') : 'none', 'mm', ofMesh(mesh ? [...mesh.slice(2)].map(v => numberText(v)) : []));
  if (mapTime === undefined) setReading('time', '–', '', 'this page has no model');
  else setReading('time', numberText(mapTime, 2), 'ms', exact ? 'by the exact engine' : 'by the network');
  const compared = here(state.compared), grey = figures.accuracy;
  if (exact) setReading('error', 'none', '', 'the map is exact');
  else if (compared) setReading('error', numberText(compared.rmse, 2), 'mm', `here, root mean square; exact engine: ${numberText(compared.time, 2)} ms`);
  else setReading('error', numberText(grey.rmse_mm, 2), 'mm', `root mean square, ${numberText(grey.shapes)} held-out shapes`);
}

// sliders

// The step of a slider: 1, 2 or 5 times a power of ten, about 300 over the range.
const stepOf = p => contourStep((p.max - p.min) / 42);
const rounded = (x, step) => Number((Math.round(x / step) * step).toFixed(Math.max(0, Math.min(12, 1 - Math.floor(Math.log10(step))))));
const clamped = (x, [low, high]) => Math.min(Math.max(x, low), high);

const sliders = parameters.map((p, i) => {
  const range = element('input', { type: 'range', step: 'any', min: p.min, max: p.max, id: 'slider' + i, 'aria-describedby': 'range' + i });
  const number = element('input', { type: 'number', step: 'any', 'aria-label': `${p.name}, value` });
  const note = element('span', { class: 'range', id: 'range' + i },
    (fit ? fittedText(p) + '; ' : '') + `trained ${numberText(p.min)} … ${withUnit(p.max, p.unit)}, default ${numberText(p.default)}`);
  const row = element('div', { class: 'slider', title: p.help || '' },
    element('label', { for: 'slider' + i }, p.name, element('small', {}, p.help || '')),
    element('span', { class: 'value' }, number, element('small', {}, p.unit)), range, note);
  range.addEventListener('input', () => setParameter(i, rounded(range.valueAsNumber, stepOf(p))));
  // keys move by a step, not by the tiny one of step="any"
  range.addEventListener('keydown', event => {
    const steps = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 }[event.key];
    if (!steps) return;
    event.preventDefault();
    setParameter(i, rounded(state.values[i] + steps * stepOf(p), stepOf(p)));
    showSliders(); // the browser itself does not move it
  });
  number.addEventListener('change', () => { if (Number.isFinite(number.valueAsNumber)) setParameter(i, number.valueAsNumber); });
  range.addEventListener('dblclick', () => moveTo(state.values.map((v, k) => (k === i ? home[i] : v))));
  $('sliders').append(row);
  return { range, number, row };
});

// What does not change is not set again: each setting makes the browser compute styles.
function showSliders() {
  parameters.forEach((p, i) => {
    const { range, number, row } = sliders[i], value = state.values[i], text = numberText(value, 5).replace('\u2009', '');
    if (range.valueAsNumber !== value) range.value = value;
    if (document.activeElement !== number && number.value !== text) number.value = text;
    row.classList.toggle('beyond', value < p.min || value > p.max);
  });
}

// Gives the sliders the ranges that the page can compute.
function showRanges() {
  parameters.forEach((p, i) => {
    const { range, row } = sliders[i], [low, high] = state.ranges[i], share = x => 100 * (x - low) / (high - low) + '%';
    Object.assign(range, { min: low, max: high });
    row.style.setProperty('--low', share(p.min));
    row.style.setProperty('--high', share(p.max));
  });
}

let animation = 0;

function setParameter(i, value) {
  cancelAnimationFrame(animation);
  state.values[i] = clamped(value, state.ranges[i]);
  request();
}

// Moves all parameters to `target`, smoothly unless the reader prefers no motion.
function moveTo(target, duration = 700) {
  cancelAnimationFrame(animation);
  const start = performance.now(), from = [...state.values];
  function step(now) {
    const t = calm.matches ? 1 : Math.min((now - start) / duration, 1), share = t * t * (3 - 2 * t);
    state.values = t < 1 ? from.map((v, i) => v + share * (target[i] - v)) : [...target];
    request();
    if (t < 1) animation = requestAnimationFrame(step);
  }
  animation = requestAnimationFrame(step);
}

function randomValues() {
  return parameters.map(p => rounded(p.min + Math.random() * (p.max - p.min), stepOf(p))).map((v, i) => clamped(v, [parameters[i].min, parameters[i].max]));
}

const buttons = [
  element('button', { type: 'button', onclick: () => moveTo(home) }, fit ? 'Fitted' : 'Default'),
  element('button', { type: 'button', onclick: () => moveTo(randomValues()) }, 'Random shape'),
  element('button', { type: 'button', id: 'compare', hidden: '', onclick: () => worker.postMessage({ compare: [...state.values] }) }, 'Compare with the exact map')
];
document.querySelector('.buttons').append(...buttons);

// maps

// The first maps are slow: the browser improves the code of the runtime while it runs.
const WARM = 4;
let worker = null;

// The texts change with the picture, so that the browser lays out and paints once; where a map takes long, the sliders' own come first.
const LONG = 60; // ms
let slidersTimer = 0;

// Asks for the map at the values of the sliders. While a map is computed, only the latest values wait.
function request() {
  if (!slidersTimer) slidersTimer = setTimeout(showSlidersNow, LONG);
  state.wanted = true;
  if (!state.busy) send();
}

function showSlidersNow() {
  clearTimeout(slidersTimer);
  slidersTimer = 0;
  showSliders();
}

function send() {
  state.busy = true;
  state.wanted = false;
  worker.postMessage({ map: [...state.values], depth: state.depth });
}

function showMap(map) {
  state.map = map;
  if (document.documentElement.classList.contains('exact') !== map.exact) document.documentElement.classList.toggle('exact');
  if (surfaceView) surfaceView.show(map.vertices, map.triangles, !map.cut);
  drawSlices();
  showSlidersNow();
  showReadings(map);
  showMeasures(map.own, state.depth);
  const extra = map.exact ? 'exact engine: beyond the trained range' : 'network';
  if (surfaceView) setText($('source'), `${extra} · map ${numberText(map.mapTime, 2)} ms · surface ${numberText(map.surfaceTime, 2)} ms`);
  state.drawn++;
  state.busy = false;
  if (state.wanted || state.drawn < WARM) send();
  else {
    startRest();
    for (const done of state.waiting.splice(0)) done();
  }
}

// When the sliders have come to rest, the mesh is measured, and sweeps are computed one parameter after the other, so that a slider that
// moves again does not wait.
const SWEEP_REST = 400, SWEEP_PARAMETERS_MAX = 12;
let restTimer = 0, sweeps = [];

function startRest() {
  clearTimeout(restTimer);
  restTimer = setTimeout(() => {
    sweeps = [];
    if (state.knowsShape) worker.postMessage({ measure: [...state.values] });
    if (parameters.length <= SWEEP_PARAMETERS_MAX) sendSweep();
  }, SWEEP_REST);
}

function sendSweep() {
  const index = sweeps.length, { min, max } = parameters[index];
  // the others must be in the trained range, too: the exact engine would take too long
  const values = Array.from({ length: SWEEP_STEPS }, (_, k) => min + k / (SWEEP_STEPS - 1) * (max - min));
  worker.postMessage({ sweep: { parameters: parameters.map((p, i) => clamped(state.values[i], [p.min, p.max])), index, values } });
}

function takeSweep({ parameters: at, index, measures }) {
  if (index !== sweeps.length || at.some((v, i) => v !== clamped(state.values[i], [parameters[i].min, parameters[i].max]))) return;
  sweeps.push(measures);
  if (sweeps.length < parameters.length) sendSweep();
  else showSweeps(sweeps, at);
}

function onReady({ ranges, knowsShape }) {
  state.ranges = parameters.map((_, i) => [ranges[2 * i], ranges[2 * i + 1]]);
  state.knowsShape = knowsShape;
  $('compare').hidden = !knowsShape;
  $('legend').hidden = !parameters.some((p, i) => state.ranges[i][0] < p.min || state.ranges[i][1] > p.max);
  document.body.classList.add('ready');
  state.busy = false;
  showRanges();
  request();
}

function startWorker() {
  worker = new Worker(URL.createObjectURL(new Blob([$('worker').textContent], { type: 'text/javascript' })));
  worker.onmessage = ({ data }) => {
    if (data.ready) onReady(data.ready);
    if (data.map) showMap(data.map);
    if (data.sweep) takeSweep(data.sweep);
    if (data.compare || data.measure) {
      if (data.compare) state.compared = data.compare;
      else state.ofMesh = data.measure;
      showReadings(state.map);
    }
    if (data.error) {
      state.busy = false;
      notice(data.error);
    }
  };
  worker.onerror = event => notice('The model cannot run in this browser: ' + event.message);
  worker.postMessage({ open: { runtime: $('runtime').textContent.trim(), model: $('model').textContent.trim() } });
  // the texts are large and no longer needed
  $('model').textContent = $('runtime').textContent = '';
}

// texts

function showTexts() {
  const { network, accuracy } = figures, size = grid.size.join(' × ');
  const spacing = new Set(grid.spacing).size === 1 ? numberText(grid.spacing[0]) : grid.spacing.map(v => numberText(v)).join(' × ');
  $('about').textContent = fit ? `Fitted to ${String(figures.fit.image).split('/').pop()}` : figures.summary || '';
  $('sizes').textContent = `${parameters.length} parameter${parameters.length > 1 ? 's' : ''} · ${size} voxels of ${spacing} mm · network ${network.kind}`;
  $('program').textContent = figures.program;
  const mm = x => withUnit(x, 'mm');
  fillTable($('accuracy'), [
    ['Root mean square', mm(accuracy.rmse_mm)], [`… within ${mm(accuracy.near_mm)} of the surface`, mm(accuracy.rmse_near_mm)],
    ['Mean', mm(accuracy.mae_mm)], ['Largest', mm(accuracy.max_abs_mm)],
    ['Half of the maps have at most', mm(accuracy.q50_mm)], ['99 % of the maps have at most', mm(accuracy.q99_mm)], ['Shapes', numberText(accuracy.shapes)]
  ]);
  fillTable($('network'), [
    ['Kind', network.kind], ['Trained in', withUnit(network.train_seconds, 's')], ['Exact maps used', numberText(network.train_maps)],
    ['Size', withUnit(network.file_bytes / 1e6, 'MB')], ['Multiply-adds per map', numberText(network.multiply_adds)],
    ['Seed', String(network.seed)], ['Checksum', network.checksum]
  ]);
  if (fit) showFit();
  if (figures.history) showHistory(figures.history);
  if (figures.errors) showErrors(figures.errors);
}

// For scripts: set() takes values by name; drawn() is a promise of the picture of the latest values; map() is the last map, a Float32Array
// [nz][ny][nx] in mm.
window.sdmgen = {
  figures,
  set(values) {
    parameters.forEach((p, i) => { if (p.name in values) state.values[i] = clamped(values[p.name], state.ranges[i]); });
    request();
    return this.drawn();
  },
  drawn: () => new Promise(done => (state.busy ? state.waiting.push(done) : done())),
  map: () => state.map && state.map.values
};

showTexts();
startMeasures(state.depth, depth => {
  state.depth = depth;
  request();
});
if (figures.live) {
  showRanges();
  showSliders();
  startWorker();
} else {
  $('controls').hidden = true;
  if (surfaceView) surfaceView.show(still.vertices, still.triangles, !box.cut);
  drawSlices();
  showReadings({ volume: box.volume_mm3, area: box.area_mm2, box: [...box.min, ...box.max], cut: box.cut });
}
