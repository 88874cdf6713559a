// The figures of the page, numbers as text, and small helpers for elements.
const $ = id => document.getElementById(id);
const figures = JSON.parse($('figures').textContent);

// A number with three significant digits, or as many as `digits`; thousands are set apart.
function numberText(x, digits = 3) {
  if (!Number.isFinite(x)) return '–';
  const size = Math.abs(x);
  if (size >= 1e7 || (size > 0 && size < 1e-4)) return x.toExponential(digits - 1).replace('e+', 'e');
  if (size >= 10 ** digits) return Math.round(x).toString().replace(/\B(?=(\d{3})+$)/g, '\u2009');
  return String(Number(x.toPrecision(digits)));
}

const withUnit = (x, unit, digits) => numberText(x, digits) + (unit ? '\u00a0' + unit : '');

// A new element with attributes and children; texts never become HTML.
function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith('on')) made.addEventListener(key.slice(2), value);
    else if (value !== false) made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

function fillTable(table, rows) {
  for (const [name, value] of rows) table.append(element('tr', {}, element('th', { scope: 'row' }, name), element('td', {}, value)));
}

const calm = matchMedia('(prefers-reduced-motion: reduce)');

// The value of a colour in the style sheet, as red, green, blue from 0 to 1.
function colour(name) {
  const digits = getComputedStyle(document.documentElement).getPropertyValue(name).trim().slice(1);
  return [0, 2, 4].map(i => parseInt(digits.slice(i, i + 2), 16) / 255);
}

const cssColour = ([r, g, b], alpha = 1) => `rgb(${r * 255} ${g * 255} ${b * 255} / ${alpha})`;

// Calls draw() when the size of the element or the colours of the page change.
function onChange(target, draw) {
  new ResizeObserver(draw).observe(target);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
}

// Sets the size of a canvas in pixels of the screen; returns pixels for a length of the page.
function fitCanvas(canvas) {
  const ratio = Math.min(devicePixelRatio || 1, 2);
  const width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.max(1, Math.round(canvas.clientHeight * ratio));
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  return ratio;
}
