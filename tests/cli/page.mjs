// The pages of page.sh in chromium: node page.mjs CHROMIUM, in the folder of live.html, still.html, fitted.html, hostile.html, native.npy, beyond.npy and beyond.json.
import { readFileSync, writeFileSync } from 'node:fs';
import { argv, exit } from 'node:process';
import { startBrowser } from './browser.mjs';

let failures = 0;
function check(fine, text) {
  if (fine) return;
  failures++;
  console.error('FAILED: ' + text);
}

const floatsOf = file => {
  const bytes = readFileSync(file);
  return new Float32Array(bytes.buffer.slice(bytes.byteOffset + 128, bytes.byteOffset + bytes.length));
};

// Sets a slider as a reader does, by an event of its input element; gives the map, base64.
const MOVE = `async (name, value) => {
  const { parameters } = sdmgen.figures, i = parameters.findIndex(p => p.name === name);
  const number = document.querySelectorAll('#sliders input[type=number]')[i];
  number.value = value;
  number.dispatchEvent(new Event('change'));
  await sdmgen.drawn();
  const bytes = new Uint8Array(sdmgen.map().slice().buffer);
  let text = '';
  for (let at = 0; at < bytes.length; at += 8192) text += String.fromCharCode(...bytes.subarray(at, at + 8192));
  return btoa(text);
}`;
const move = async (page, name, value) => {
  const bytes = Buffer.from(await page.evaluate(`(${MOVE})('${name}', ${value})`), 'base64');
  return new Float32Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
};

// The number of pixels of the surface that are not those of the background, and a sum that tells pictures apart.
const LOOK = `(() => {
  const canvas = document.getElementById('surface'), copy = document.createElement('canvas');
  Object.assign(copy, { width: canvas.width, height: canvas.height });
  const context = copy.getContext('2d');
  context.drawImage(canvas, 0, 0);
  const { data } = context.getImageData(0, 0, copy.width, copy.height);
  let filled = 0, sum = 0;
  for (let i = 0; i < data.length; i += 4) if ([0, 1, 2].some(c => data[i + c] !== data[c])) { filled++; sum = (sum * 31 + data[i] + data[i + 1] * i) % 2147483647; }
  return { filled, sum, all: data.length / 4 };
})()`;

async function waitFor(page, condition) {
  for (let i = 0; i < 600; i++) {
    if (await page.evaluate(`!!(${condition})`)) return true;
    await new Promise(done => setTimeout(done, 50));
  }
  check(false, 'never true: ' + condition);
  return false;
}

const sameBits = (a, b) => a.length === b.length && Buffer.from(a.buffer).equals(Buffer.from(b.buffer));
const farthest = (a, b) => a.reduce((most, v, i) => Math.max(most, Math.abs(v - b[i])), 0);
const clean = (page, name) => {
  check(page.complaints.length === 0, `${name}: the console has: ${page.complaints.join(' | ')}`);
  check(page.requests.length === 0, `${name}: requests: ${page.requests.join(' ')}`);
};

async function checkLive(browser) {
  const page = await browser.open('live.html');
  if (!(await waitFor(page, 'window.sdmgen && sdmgen.map() && document.body.classList.contains("ready")'))) return;
  const first = await page.evaluate(LOOK);
  check(first.filled > first.all / 50 && first.filled < first.all * 0.9, `the surface fills ${first.filled} of ${first.all} pixels`);
  // the map after moving sliders
  await move(page, 'rx', 2.6);
  const map = await move(page, 'rz', 3.1), native = floatsOf('native.npy');
  check(sameBits(map, native), `another map than by the program, ${farthest(map, native)} mm away`);
  const second = await page.evaluate(LOOK);
  check(second.sum !== first.sum, 'the second picture is that of the first map');
  // beyond the trained range
  await page.evaluate(`document.querySelector('.buttons button').click()`);
  await waitFor(page, `document.querySelectorAll('#sliders input[type=number]')[0].value == sdmgen.figures.parameters[0].default`);
  await page.evaluate('new Promise(done => setTimeout(done, 1000))');
  const beyond = await move(page, 'rx', 4.6);
  check(farthest(beyond, floatsOf('beyond.npy')) < 1e-5, `beyond the range ${farthest(beyond, floatsOf('beyond.npy'))} mm away from the exact map`);
  // the measures of the mesh are those of the program, the volume of the map is near
  await waitFor(page, 'state.ofMesh?.parameters[0] === 4.6');
  const names = ['volume', 'area', 'extent_x', 'extent_y', 'extent_z'], { measures } = JSON.parse(readFileSync('beyond.json'));
  const { volume, values } = await page.evaluate('({ volume: state.map.volume, values: [...state.ofMesh.values] })');
  names.forEach((name, i) => {
    const value = measures.find(m => m.name === name).value;
    check(Math.abs(values[i] / value - 1) < 1e-9, `${name} of the mesh ${values[i]}, by the program ${value}`);
  });
  check(Math.abs(volume / values[0] - 1) < 0.02, `volume of the map ${volume}, of the mesh ${values[0]}`);
  check(await page.evaluate('/of the mesh 114.9/.test($("readings").textContent)'), 'the page does not show the volume of the mesh');
  check(await page.evaluate(`document.documentElement.classList.contains('exact') && document.querySelector('.slider').classList.contains('beyond')`), 'no sign of the exact engine');
  // values are kept within the range of the shape
  await move(page, 'rx', 99);
  check(await page.evaluate(`document.querySelector('#sliders input[type=number]').value`) === '5', 'a value beyond the range of the shape');
  // a real key on a slider
  await page.evaluate(`document.querySelector('#sliders input[type=range]').focus()`);
  await page.command('Input.dispatchKeyEvent', { type: 'keyDown', key: 'ArrowLeft', code: 'ArrowLeft', windowsVirtualKeyCode: 37 });
  check(await page.evaluate(`Number(document.querySelector('#sliders input[type=number]').value) < 5`), 'the arrow key does not move the slider');
  // compared with the exact map
  await page.evaluate(`document.getElementById('compare').click()`);
  await waitFor(page, `/exact engine/.test(document.getElementById('readings').textContent)`);
  clean(page, 'live.html');
}

// The page of a fit: image, contours, verdict; and the standard deviation at the end of the x axis of the ellipsoid, where the distance
// depends on rx and on the translation along the axis alone, both with slope -1.
async function checkFit(browser) {
  const page = await browser.open('fitted.html');
  if (!(await waitFor(page, 'window.sdmgen && sdmgen.map() && document.body.classList.contains("ready")'))) return;
  const [sd, tip] = await page.evaluate(`(() => {
    const { fit: { parameters, covariance, unknowns, pose }, grid: { size, spacing, origin } } = figures, n = unknowns.length;
    const turn = pose.rotation_rad, angle = Math.hypot(...turn), axis = turn.map(v => v / (angle || 1)), c = Math.cos(angle);
    // the x axis of the shape in the world (Rodrigues)
    const x = [c + (1 - c) * axis[0] ** 2, axis[2] * Math.sin(angle) + (1 - c) * axis[0] * axis[1], -axis[1] * Math.sin(angle) + (1 - c) * axis[0] * axis[2]];
    const slope = unknowns.map(name => name === 'rx' ? -1 : name.startsWith('translation') ? -x['xyz'.indexOf(name.at(-1))] : 0);
    let variance = 0;
    for (let i = 0; i < n; i++) for (let k = 0; k < n; k++) variance += slope[i] * covariance[i][k] * slope[k];
    const at = [parameters.rx, 0, 0].map((v, a) => Math.round((v - origin[a]) / spacing[a]));
    return [Math.sqrt(variance), fit.sd[(at[2] * size[1] + at[1]) * size[0] + at[0]]];
  })()`);
  check(Math.abs(tip - sd) < 0.15 * sd, `standard deviation at the end of the x axis ${tip} mm, from the covariance ${sd} mm`);
  const looks = () => page.evaluate(`[...document.querySelectorAll('#slices canvas')].map(c => {
    const copy = Object.assign(document.createElement('canvas'), { width: c.width, height: c.height }).getContext('2d', { willReadFrequently: true });
    copy.drawImage(c, 0, 0);
    const { data } = copy.getImageData(0, 0, c.width, c.height), counts = { teal: 0, orange: 0, grey: new Set() };
    for (let i = 0; i < data.length; i += 4) {
      const [r, g, b] = data.slice(i, i + 3);
      if (g > r + 80) counts.teal++;
      else if (r > b + 120) counts.orange++;
      else if (r === g && g === b) counts.grey.add(r);
    }
    return [counts.teal, counts.orange, counts.grey.size];
  })`);
  // slices out of sight are drawn later
  await page.evaluate(`document.getElementById('slices').scrollIntoView(), new Promise(done => setTimeout(done, 500))`);
  const before = await looks();
  check(before.every(([teal, orange, grey]) => teal > 100 && orange === 0 && grey > 50), `slices of the fit: ${JSON.stringify(before)}`);
  await move(page, 'rx', 3.6);
  const after = await looks();
  check(after.every(([teal, orange]) => teal > 50) && after[2][1] > 50, `slices after a slider: ${JSON.stringify(after)}`);
  check(await page.evaluate(`document.querySelectorAll('#correlations rect').length === figures.fit.unknowns.length ** 2`), 'no correlations');
  check(await page.evaluate(`document.querySelectorAll('#verdict li').length === figures.fit.verdict.checks.length`), 'not all checks of the verdict');
  await page.evaluate(`document.querySelector('.buttons button').click()`);
  await waitFor(page, `state.map.parameters.every((v, i) => v === home[i])`);
  clean(page, 'fitted.html');
}

// Texts of a fit that try to be code are text.
async function checkHostile(browser) {
  const page = await browser.open('hostile.html');
  await waitFor(page, 'window.sdmgen');
  check(/<script>alert\(1\)/.test(await page.evaluate('document.getElementById("verdict").textContent')), 'the text of the doubt is not shown as it is');
  clean(page, 'hostile.html');
}

// The layout keeps to the width of the window, in light and in dark, and differs between them.
async function checkLayout(browser, file, name, widths = [390, 1280]) {
  const pictures = new Set();
  for (const width of widths) {
    for (const value of ['light', 'dark']) {
      const page = await browser.open(file, { width, height: 844, features: [{ name: 'prefers-color-scheme', value }, { name: 'prefers-reduced-motion', value: 'reduce' }] });
      await waitFor(page, 'window.sdmgen && (!sdmgen.figures.live || sdmgen.map())');
      const wide = await page.evaluate('document.documentElement.scrollWidth');
      check(wide <= width, `${name} is ${wide} pixels wide in a window of ${width}`);
      const picture = await page.picture();
      writeFileSync(`${name}-${width}-${value}.png`, picture);
      pictures.add(picture.toString('base64'));
      clean(page, `${name} ${width} ${value}`);
    }
  }
  check(pictures.size === 2 * widths.length, `${name}: ${pictures.size} different pictures instead of ${2 * widths.length}`);
}

async function checkWithoutWebgl(program) {
  const browser = startBrowser(program, ['--disable-3d-apis']);
  const page = await browser.open('live.html');
  await waitFor(page, 'window.sdmgen && sdmgen.map()');
  await waitFor(page, `[...document.querySelectorAll('#slices canvas')].every(c => c.getContext('2d').getImageData(c.width >> 1, c.height >> 1, 1, 1).data[3] === 255)`);
  check(/no WebGL2/.test(await page.evaluate('document.body.textContent')), 'without WebGL the page says nothing');
  check(page.requests.length === 0, 'requests without WebGL');
  await browser.close();
}

const browser = startBrowser(argv[2]);
await checkLive(browser);
await checkLayout(browser, 'live.html', 'live');
await checkLayout(browser, 'still.html', 'still');
await checkFit(browser);
await checkHostile(browser);
await checkLayout(browser, 'fitted.html', 'fitted', [390]);
await browser.close();
await checkWithoutWebgl(argv[2]);
exit(failures ? 1 : 0);
