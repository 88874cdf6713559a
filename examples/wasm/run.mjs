// Runs a WASI program in Node.js: node run.mjs PROGRAM.wasm [ARGUMENT ...].
// The program can access the current folder.
import { readFile } from 'node:fs/promises';
import { argv, exit } from 'node:process';
import { WASI } from 'node:wasi';

const [program, ...args] = argv.slice(2);
if (!program) {
  console.error('usage: node run.mjs PROGRAM.wasm [ARGUMENT ...]');
  exit(2);
}
const wasi = new WASI({
  version: 'preview1', args: [program, ...args], preopens: { '.': '.' }, returnOnExit: true
});
const module = await WebAssembly.compile(await readFile(program));
const instance = await WebAssembly.instantiate(module, { wasi_snapshot_preview1: wasi.wasiImport });
exit(wasi.start(instance));
