// Times from the event of a slider to the picture, in chromium: node page_times.mjs CHROMIUM PAGE.html [PAGE.html ...]
// Several pages take turns, so that an old and a new one are compared on a machine that does other things. Nothing is judged.
import { argv } from 'node:process';
import { startBrowser } from './browser.mjs';

const MOVES = 50;

// Medians (ms) over the moves of the first slider: map and surface computed; page drawn; pixels of WebGL finished; next frame of the
// screen begun.
const MEASURE = `(async () => {
  for (let i = 0; i < 1200 && !(window.sdmgen?.map() && document.body.classList.contains('ready')); i++) await new Promise(done => setTimeout(done, 50));
  const slider = document.querySelector('#sliders input[type=range]'), gl = document.getElementById('surface').getContext('webgl2');
  const { min, max } = sdmgen.figures.parameters[0], times = [[], [], [], []], frame = () => new Promise(requestAnimationFrame);
  for (let i = 0; i < ${MOVES}; i++) {
    await frame();
    const start = performance.now(), since = () => performance.now() - start;
    slider.value = min + (max - min) * (0.25 + 0.5 * i / ${MOVES});
    slider.dispatchEvent(new Event('input'));
    await sdmgen.drawn();
    times[0].push(state.map.mapTime + state.map.surfaceTime);
    times[1].push(since());
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    times[2].push(since());
    await frame();
    times[3].push(since());
  }
  return times.map(list => list.sort((a, b) => a - b)[list.length >> 1]);
})()`;

const [program, ...files] = argv.slice(2), browser = startBrowser(program);
for (let round = 0; round < (files.length > 1 ? 3 : 1); round++) {
  for (const file of files) {
    const page = await browser.open(file), before = await browser.busy(), times = await page.evaluate(MEASURE), after = await browser.busy();
    const busy = Object.keys(after).map(type => `${type} ${(1000 / MOVES * (after[type] - (before[type] ?? 0))).toFixed(0)}`);
    console.log(`${file}: map and surface ${times[0].toFixed(1)}, page drawn ${times[1].toFixed(1)}, pixels of WebGL ${times[2].toFixed(1)}, ` +
      `next frame ${times[3].toFixed(1)} ms; processor time a move, ms: ${busy.join(', ')}`);
    await page.close();
  }
}
await browser.close();
