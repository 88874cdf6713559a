// The figures of the page, numbers as text, and small helpers for elements.
'use strict';
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

// Sets the text of an element; one that has it already is not laid out and painted again.
function setText(of, text) {
  if (of.textContent !== text) of.textContent = text;
}

const calm = matchMedia('(prefers-reduced-motion: reduce)');

// The value of a colour in the style sheet, as red, green, blue from 0 to 1.
function colour(name) {
  const digits = getComputedStyle(document.documentElement).getPropertyValue(name).trim().slice(1);
  return [0, 2, 4].map(i => parseInt(digits.slice(i, i + 2), 16) / 255);
}

const cssColour = ([r, g, b], alpha = 1) => `rgb(${r * 255} ${g * 255} ${b * 255} / ${alpha})`;

// Calls draw() when the size of the canvas or the colours of the page change. Returns a function that sets the number of pixels of the
// canvas, `share` of those of the screen, and gives the pixels for a length of the page. It asks for no layout: drawing stays fast.
function onChange(canvas, draw) {
  let width = canvas.clientWidth, height = canvas.clientHeight;
  new ResizeObserver(() => {
    width = canvas.clientWidth;
    height = canvas.clientHeight;
    draw();
  }).observe(canvas);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
  return (share = 1) => {
    const ratio = share * Math.min(devicePixelRatio || 1, 2);
    const pixels = { width: Math.max(1, Math.round(width * ratio)), height: Math.max(1, Math.round(height * ratio)) };
    if (canvas.width !== pixels.width || canvas.height !== pixels.height) Object.assign(canvas, pixels);
    return ratio;
  };
}

// The colours of these names in the style sheet, read once for each scheme of colours.
function colours(...names) {
  let read = null;
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => { read = null; });
  return () => (read ??= Object.fromEntries(names.map(name => [name, colour('--' + name)])));
}
