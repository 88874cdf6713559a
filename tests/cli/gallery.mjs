// The pages of gallery.sh in chromium: node gallery.mjs CHROMIUM, in the folder of pages/ and of the maps that the program computed.
import { readFileSync } from 'node:fs';
import { argv, exit } from 'node:process';
import { startBrowser } from './browser.mjs';

let failures = 0;
function check(fine, text) {
  if (fine) return;
  failures++;
  console.error('FAILED: ' + text);
}

const browser = startBrowser(argv[2]);
for (const [name, values] of [['linkage', { q1: 0.5 }], ['statistical', { m1: 0.5 }], ['cochlea', { a: 3.5 }]]) {
  const page = await browser.open(`pages/${name}.html`, { features: [{ name: 'prefers-reduced-motion', value: 'reduce' }] });
  const { bits, filled, own } = await page.evaluate(`(async () => {
    for (let i = 0; i < 1200 && !(window.sdmgen?.map() && document.body.classList.contains('ready')); i++) await new Promise(done => setTimeout(done, 50));
    await sdmgen.set(${JSON.stringify(values)});
    const bytes = new Uint8Array(sdmgen.map().slice().buffer), canvas = document.getElementById('surface');
    const copy = Object.assign(document.createElement('canvas'), { width: canvas.width, height: canvas.height }).getContext('2d', { willReadFrequently: true });
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
    let filled = 0;
    for (let i = 0; i < data.length; i += 4) filled += data[i] !== data[0];
    return { own: state.map.own && Array.from(state.map.own), bits: btoa(Array.from(bytes, b => String.fromCharCode(b)).join('')), filled };
  })()`);
  const want = readFileSync(name + '.npy').subarray(128), got = Buffer.from(bits, 'base64');
  check(got.equals(want), `${name}: another map than by the program`);
  check(filled > 1000, `${name}: the surface fills ${filled} pixels`);
  if (name === 'cochlea') {
    const { measures } = JSON.parse(readFileSync('cochlea.json'));
    check(own.length === measures.length - 5 && own.every((v, i) => Math.abs(v / measures[i].value - 1) < 1e-9), `measures ${own}, by the program ${JSON.stringify(measures)}`);
    const shown = await page.evaluate('document.getElementById("measures").textContent');
    check(shown.includes(Number(measures[0].value.toPrecision(5)).toString()), `the page shows ${shown}`);
  }
  check(page.complaints.length === 0, `${name}: the console has: ${page.complaints.join(' | ')}`);
  check(page.requests.length === 0, `${name}: requests: ${page.requests.join(' ')}`);
}
const index = await browser.open('pages/index.html', { width: 390 });
check(await index.evaluate('document.links.length') === 4, 'the index has not four links');
check(await index.evaluate('document.documentElement.scrollWidth') <= 390, 'the index is wider than a phone');
check(index.complaints.length === 0, `index: the console has: ${index.complaints.join(' | ')}`);
await browser.close();
exit(failures ? 1 : 0);
