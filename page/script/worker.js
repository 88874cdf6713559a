// The worker of a page: runs the runtime (page_runtime.c as WebAssembly) in a thread of its own.
// Messages to it: {open: {runtime, model}} once, base64 texts; {map: parameters, depth}: depth (mm) of the measures of a depth; {compare: parameters};
// {measure: parameters}: measures of the mesh;
// {sweep: {parameters, index, values}}: volume and area while one parameter takes these values.
// Its answers: {ready}, {map}, {compare}, {measure}, {sweep}, each with its results; {error: text}.
'use strict';
let runtime;

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

function unzipped(bytes) {
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'))).arrayBuffer();
}

// The system calls of WASI: a page has no files, so each fails with "bad file descriptor".
function systemCalls(module) {
  const calls = {};
  for (const { name } of WebAssembly.Module.imports(module)) calls[name] = () => 8;
  calls.proc_exit = code => { throw new Error('the runtime ended with code ' + code); };
  return { wasi_snapshot_preview1: calls };
}

// Copies of results: the memory of the runtime may move when it grows.
const floats = (at, n) => new Float32Array(runtime.memory.buffer, at, n).slice();
const doubles = (at, n) => new Float64Array(runtime.memory.buffer, at, n).slice();
const words = (at, n) => new Uint32Array(runtime.memory.buffer, at, n).slice();

function check(failed) {
  if (!failed) return;
  const text = new Uint8Array(runtime.memory.buffer, runtime.page_message());
  throw new Error(new TextDecoder().decode(text.slice(0, text.indexOf(0))));
}

async function open(texts) {
  const module = await WebAssembly.compile(await unzipped(bytesOf(texts.runtime)));
  runtime = (await WebAssembly.instantiate(module, systemCalls(module))).exports;
  runtime._initialize();
  const model = bytesOf(texts.model);
  const at = runtime.page_alloc(model.length);
  if (!at) throw new Error('not enough memory for the model');
  new Uint8Array(runtime.memory.buffer, at, model.length).set(model);
  check(runtime.page_open(at, model.length));
  postMessage({
    ready: { ranges: doubles(runtime.page_ranges(), 2 * runtime.page_n_params()), knowsShape: !!runtime.page_knows_shape() }
  });
}

function setParameters(parameters) {
  new Float64Array(runtime.memory.buffer, runtime.page_params(), parameters.length).set(parameters);
}

function map(parameters, depth) {
  setParameters(parameters);
  const start = performance.now();
  check(runtime.page_map());
  const between = performance.now();
  check(runtime.page_surface());
  const end = performance.now();
  const [volume, area, ...box] = doubles(runtime.page_measures(), 8), nOwn = runtime.page_n_own_measures();
  const result = {
    parameters, volume, area, box, own: nOwn ? doubles(runtime.page_own_measures(depth), nOwn) : null, cut: !!runtime.page_is_cut(), exact: !!runtime.page_was_exact(),
    mapTime: between - start, surfaceTime: end - between,
    values: floats(runtime.page_values(), runtime.page_n_values()),
    vertices: floats(runtime.page_vertices(), 6 * runtime.page_n_vertices()),
    triangles: words(runtime.page_triangles(), 3 * runtime.page_n_triangles())
  };
  postMessage({ map: result }, [result.values.buffer, result.vertices.buffer, result.triangles.buffer]);
}

// Compares the map of the network with that of the exact engine.
function compare(parameters) {
  setParameters(parameters);
  check(runtime.page_map());
  const network = floats(runtime.page_values(), runtime.page_n_values());
  const start = performance.now();
  check(runtime.page_exact());
  const time = performance.now() - start;
  const exact = floats(runtime.page_values(), runtime.page_n_values());
  let sum = 0, largest = 0;
  for (let i = 0; i < exact.length; i++) {
    const difference = Math.abs(network[i] - exact[i]);
    sum += difference * difference;
    largest = Math.max(largest, difference);
  }
  postMessage({ compare: { parameters, time, rmse: Math.sqrt(sum / exact.length), largest } });
}

function measure(parameters) {
  setParameters(parameters);
  postMessage({ measure: { parameters, values: doubles(runtime.page_mesh_measures(), 5) } });
}

function sweep({ parameters, index, values }) {
  const measures = values.map(value => {
    setParameters(parameters.map((v, i) => (i === index ? value : v)));
    if (runtime.page_map() || runtime.page_surface()) return [NaN, NaN];
    const [volume, area] = doubles(runtime.page_measures(), 8);
    return runtime.page_is_cut() ? [NaN, NaN] : [volume, area];
  });
  postMessage({ sweep: { parameters, index, measures } });
}

onmessage = async ({ data }) => {
  try {
    if (data.open) await open(data.open);
    if (data.map) map(data.map, data.depth);
    if (data.compare) compare(data.compare);
    if (data.measure) measure(data.measure);
    if (data.sweep) sweep(data.sweep);
  } catch (error) {
    postMessage({ error: error.message });
  }
};
