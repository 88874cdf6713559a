// onnx_run.mjs FILE.onnx PARAMS.csv OUT.f32: evaluates an ONNX file by onnxruntime-web for all rows of the table (a header line, then
// numbers) in one batch and writes the maps as float32.
import { readFileSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { join } from 'node:path';

const require = createRequire(join(process.env.SDM_NODE_MODULES ?? process.cwd(), 'x.js'));
const ort = require('onnxruntime-web');
const [file, table, out] = process.argv.slice(2);
const rows = readFileSync(table, 'utf8').trim().split('\n').slice(1).map((line) => line.split(',').map(Number));
ort.env.wasm.numThreads = 1;
const session = await ort.InferenceSession.create(readFileSync(file));
const params = new ort.Tensor('float32', Float32Array.from(rows.flat()), [rows.length, rows[0].length]);
const start = performance.now();
const { sdm } = await session.run({ params });
console.log(`${sdm.dims.join(' x ')}, ${(performance.now() - start).toFixed(1)} ms`);
writeFileSync(out, Buffer.from(sdm.data.buffer, sdm.data.byteOffset, sdm.data.byteLength));
