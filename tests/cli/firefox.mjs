// The page live.html of page.sh in Firefox, driven by its own protocol (Marionette) without a library: node firefox.mjs FIREFOX.
import { spawn } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createConnection } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { argv, exit } from 'node:process';
import { pathToFileURL } from 'node:url';

let failures = 0;
function check(fine, text) {
  if (fine) return;
  failures++;
  console.error('FAILED: firefox: ' + text);
}
const later = ms => new Promise(done => setTimeout(done, ms));

// Starts Firefox with an empty profile. Returns {send, close}.
async function start(program) {
  const profile = mkdtempSync(join(tmpdir(), 'page-test-')), port = join(profile, 'MarionetteActivePort');
  writeFileSync(join(profile, 'user.js'), 'user_pref("marionette.port", 0);\nuser_pref("browser.shell.checkDefaultBrowser", false);\n');
  const child = spawn(program, ['--headless', '--marionette', '--no-remote', '--profile', profile], { stdio: 'ignore' });
  for (let i = 0; i < 2400 && !existsSync(port); i++) await later(50);
  const socket = createConnection(Number(readFileSync(port, 'utf8')), '127.0.0.1'), waiting = new Map();
  let rest = Buffer.alloc(0), last = 0;
  // messages: LENGTH:[1, id, error, result]
  socket.on('data', data => {
    rest = Buffer.concat([rest, data]);
    for (let colon = rest.indexOf(58); colon > 0; colon = rest.indexOf(58)) {
      const size = Number(rest.subarray(0, colon));
      if (rest.length < colon + 1 + size) break;
      const message = JSON.parse(rest.subarray(colon + 1, colon + 1 + size));
      rest = rest.subarray(colon + 1 + size);
      if (!Array.isArray(message)) continue; // the greeting
      const [, id, error, result] = message, { done, failed } = waiting.get(id) ?? {};
      waiting.delete(id);
      if (error) failed?.(new Error(error.message));
      else done?.(result?.value ?? result);
    }
  });
  const send = (method, parameters = {}) => new Promise((done, failed) => {
    waiting.set(++last, { done, failed });
    const text = JSON.stringify([0, last, method, parameters]);
    socket.write(Buffer.byteLength(text) + ':' + text);
  });
  const close = async () => {
    const ended = new Promise(done => child.on('exit', done));
    await send('Marionette:Quit', { flags: ['eForceQuit'] }).catch(() => {});
    await ended;
    rmSync(profile, { recursive: true, force: true, maxRetries: 5 });
  };
  return { send, close };
}

// Moves sliders as a reader does, and waits for the map at their values.
const MOVE = `
const [values, done] = arguments, numbers = document.querySelectorAll('#sliders input[type=number]');
const wait = i => {
  if (!(document.body.classList.contains('ready') && window.sdmgen?.map()) && i < 2400) return void setTimeout(() => wait(i + 1), 50);
  sdmgen.figures.parameters.forEach((p, k) => {
    if (!(p.name in values)) return;
    numbers[k].value = values[p.name];
    numbers[k].dispatchEvent(new Event('change'));
  });
  document.getElementById('slices').scrollIntoView();
  // slices out of sight are drawn later
  sdmgen.drawn().then(() => setTimeout(() => done({
    map: Array.from(sdmgen.map()), requests: performance.getEntriesByType('resource').map(entry => entry.name),
    notice: document.getElementById('notice').hidden ? '' : document.getElementById('notice').textContent,
    slices: [...document.querySelectorAll('#slices canvas')].map(c => c.getContext('2d').getImageData(c.width >> 1, c.height >> 1, 1, 1).data[3])
  }), 500));
};
wait(0);`;

function judge({ map, requests, notice, slices }) {
  const bytes = readFileSync('native.npy'), native = new Float32Array(bytes.buffer.slice(bytes.byteOffset + 128, bytes.byteOffset + bytes.length));
  check(map.length === native.length && map.every((v, i) => v === native[i]), 'another map than by the program');
  check(requests.length === 0, `requests: ${requests.join(' ')}`);
  check(notice === '', `the page says: ${notice}`);
  check(slices.length === 3 && slices.every(alpha => alpha === 255), 'empty slices');
}

const browser = await start(argv[2]);
try {
  await browser.send('WebDriver:NewSession', {});
  await browser.send('WebDriver:SetTimeouts', { script: 150000, pageLoad: 150000 });
  await browser.send('WebDriver:Navigate', { url: pathToFileURL('live.html').href });
  judge(await browser.send('WebDriver:ExecuteAsyncScript', { script: MOVE, args: [{ rx: 2.6, rz: 3.1 }] }));
} finally {
  await browser.close();
}
exit(failures ? 1 : 0);
