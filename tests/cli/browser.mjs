// Drives chromium without a window by its debugging protocol, through pipes: no library, no port.
import { spawn } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

const OPTIONS = ['--headless=new', '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--remote-debugging-pipe',
  '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-extensions', '--disable-dev-shm-usage', '--hide-scrollbars'];

// Starts the browser; `more`: further options. Returns {open, busy, close}.
export function startBrowser(program, more = []) {
  const folder = mkdtempSync(join(tmpdir(), 'page-test-'));
  const child = spawn(program, [...OPTIONS, '--user-data-dir=' + folder, ...more, 'about:blank'], { stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'] });
  const waiting = new Map(), listeners = [];
  let last = 0, rest = '';
  child.stdio[4].on('data', data => {
    const lines = (rest + data).split('\0');
    rest = lines.pop();
    for (const line of lines) {
      const message = JSON.parse(line);
      if (message.id) {
        const { done, failed } = waiting.get(message.id);
        waiting.delete(message.id);
        if (message.error) failed(new Error(message.error.message));
        else done(message.result);
      } else {
        for (const listener of listeners) listener(message);
      }
    }
  });
  const send = (method, params = {}, sessionId = undefined) => new Promise((done, failed) => {
    waiting.set(++last, { done, failed });
    child.stdio[3].write(JSON.stringify({ id: last, method, params, sessionId }) + '\0');
  });
  child.on('exit', () => { for (const { failed } of waiting.values()) failed(new Error('the browser has ended')); });

  // Opens a file in a new page of this size. complaints: console messages, exceptions, violations; requests: addresses besides the file.
  async function open(file, { width = 1280, height = 900, features = [], scale = 1 } = {}) {
    const { targetId } = await send('Target.createTarget', { url: 'about:blank' });
    const { sessionId } = await send('Target.attachToTarget', { targetId, flatten: true });
    const command = (method, params) => send(method, params, sessionId);
    const complaints = [], requests = [], address = pathToFileURL(file).href;
    let loaded;
    const ready = new Promise(done => { loaded = done; });
    listeners.push(({ method, params, sessionId: from }) => {
      if (from !== sessionId) return;
      if (method === 'Runtime.exceptionThrown') complaints.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
      if (method === 'Runtime.consoleAPICalled') complaints.push(params.args.map(a => a.value).join(' '));
      if (method === 'Log.entryAdded' && !/swiftshader|GPU stall|GL Driver/i.test(params.entry.text)) complaints.push(params.entry.text);
      if (method === 'Network.requestWillBeSent' && params.request.url !== address && !/^(blob|data):/.test(params.request.url)) requests.push(params.request.url);
      if (method === 'Page.loadEventFired') loaded();
    });
    for (const domain of ['Page', 'Runtime', 'Log', 'Network']) await command(domain + '.enable');
    await command('Emulation.setDeviceMetricsOverride', { width, height, deviceScaleFactor: scale, mobile: width < 600 });
    await command('Emulation.setEmulatedMedia', { features });
    await command('Page.navigate', { url: address });
    await ready;
    async function evaluate(expression) {
      const { result, exceptionDetails } = await command('Runtime.evaluate', { expression, awaitPromise: true, returnByValue: true });
      if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
      return result.value;
    }
    async function picture(whole = false) {
      const { data } = await command('Page.captureScreenshot', { format: 'png', captureBeyondViewport: whole });
      return Buffer.from(data, 'base64');
    }
    const close = () => send('Target.closeTarget', { targetId });
    return { command, evaluate, picture, close, complaints, requests };
  }

  // The processor time (s) of the browser's processes so far: {browser, renderer, GPU, ...}.
  async function busy() {
    const sums = {};
    for (const { type, cpuTime } of (await send('SystemInfo.getProcessInfo')).processInfo) sums[type] = (sums[type] ?? 0) + cpuTime;
    return sums;
  }

  async function close() {
    const ended = new Promise(done => child.on('exit', done));
    await send('Browser.close').catch(() => {});
    await ended;
    rmSync(folder, { recursive: true, force: true, maxRetries: 5 });
  }
  return { open, busy, close };
}
