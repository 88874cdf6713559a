// Plots as SVG.
function svg(name, attributes = {}, ...children) {
  const made = document.createElementNS('http://www.w3.org/2000/svg', name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

// Ticks of a logarithmic axis: 1, 2 and 5 times the powers of ten; fewer over many decades.
function logTicks(low, high) {
  const ticks = [];
  const factors = Math.log10(high / low) > 2 ? [1] : [1, 2, 5];
  for (let power = Math.floor(Math.log10(low)); power <= Math.log10(high); power++)
    for (const k of factors) if (k * 10 ** power >= low * 0.999 && k * 10 ** power <= high * 1.001) ticks.push(k * 10 ** power);
  return ticks;
}

function linearTicks(high, count) {
  const step = contourStep(high * 7 / count), ticks = [];
  for (let x = 0; x <= high * 1.001; x += step) ticks.push(x);
  return ticks;
}

// A plot with a logarithmic y axis. curves: [{title, style, points: [[x, y], ...]}], a single point is a dot.
function plot(holder, { curves, xTitle, yTitle }) {
  const all = curves.flatMap(curve => curve.points);
  const highX = Math.max(...all.map(p => p[0])) || 1, ys = all.map(p => p[1]);
  const lowY = Math.min(...ys) / 1.25, highY = Math.max(...ys) * 1.25;
  function draw() {
    const width = Math.max(holder.clientWidth, 240), height = Math.min(Math.max(width * 0.42, 190), 300);
    const left = 58, right = 16, top = 14, bottom = 40;
    const x = v => left + v / highX * (width - left - right);
    const y = v => top + Math.log(highY / v) / Math.log(highY / lowY) * (height - top - bottom);
    const picture = svg('svg', { viewBox: `0 0 ${width} ${height}`, width, height, role: 'img', 'aria-label': `${yTitle} against ${xTitle}` });
    for (const tick of logTicks(lowY, highY)) {
      picture.append(svg('line', { class: 'grid', x1: left, x2: width - right, y1: y(tick), y2: y(tick) }),
        svg('text', { x: left - 8, y: y(tick) + 4, 'text-anchor': 'end' }, numberText(tick)));
    }
    for (const tick of linearTicks(highX, width / 90))
      picture.append(svg('text', { x: x(tick), y: height - bottom + 18, 'text-anchor': 'middle' }, numberText(tick)));
    picture.append(svg('line', { class: 'axis', x1: left, x2: width - right, y1: height - bottom, y2: height - bottom }),
      svg('text', { x: width - right, y: height - 6, 'text-anchor': 'end' }, xTitle));
    for (const { style, points } of curves) {
      if (points.length > 1) picture.append(svg('polyline', { class: style, points: points.map(p => `${x(p[0]).toFixed(1)},${y(p[1]).toFixed(1)}`).join(' ') }));
      if (points.length <= 40) for (const p of points) picture.append(svg('circle', { class: style, cx: x(p[0]), cy: y(p[1]), r: points.length > 1 ? 2.2 : 4.5 }));
    }
    const legend = element('p', { class: 'legend' }, yTitle + ': ');
    for (const { title, style } of curves) legend.append(element('span', { class: 'key ' + style }, title));
    holder.replaceChildren(legend, picture);
  }
  let width = 0;
  new ResizeObserver(() => {
    if (holder.clientWidth === width) return;
    width = holder.clientWidth;
    draw();
  }).observe(holder);
}

// Plots the errors of a training over its time, or over its steps where the run has no times.
function showHistory(history) {
  const across = history.every(point => point.seconds !== null) ? 'seconds' : 'step';
  const curve = (title, style, key, finished) => ({
    title, style,
    points: history.filter(point => (point.phase === 'evaluate') === finished && point[key] > 0 && point[across] !== null)
      .map(point => [point[across], Math.sqrt(point[key])])
  });
  const curves = [
    curve('training, one batch', 'loss', 'loss_mm2', false), curve('held-out shapes', 'heldout', 'heldout_mse_mm2', false),
    curve('finished network', 'end', 'heldout_mse_mm2', true)
  ].filter(({ points }) => points.length > 0);
  // a single point is no course
  if (!curves.some(({ points }) => points.length > 1)) return;
  $('training').hidden = false;
  plot($('history'), { curves, xTitle: across === 'step' ? 'optimiser steps' : 'seconds', yTitle: 'Root mean square error, mm' });
}

// The histogram of the errors on held-out shapes: the share of the voxels in each bin of a logarithmic axis.
function showErrors({ shapes, near_mm: nearMm, first_edge_mm: firstEdge, bins_per_decade: perDecade, voxels, near }) {
  const width = 460, height = 170, left = 8, right = 8, top = 18, bottom = 40;
  const edges = Array.from({ length: voxels.length + 1 }, (_, i) => firstEdge * 10 ** ((i - 1) / perDecade));
  const first = voxels.findIndex(n => n > 0), last = voxels.findLastIndex(n => n > 0) + 1;
  const shares = counts => counts.map(n => n / Math.max(counts.reduce((sum, v) => sum + v, 0), 1)).slice(first, last);
  const curves = [['loss', 'all voxels', shares(voxels)], ['heldout', `within ${withUnit(nearMm, 'mm')} of the surface`, shares(near)]];
  const most = Math.max(...curves.flatMap(curve => curve[2]));
  const x = v => left + Math.log(v / edges[first]) / Math.log(edges[last] / edges[first]) * (width - left - right);
  const y = v => height - bottom - v / most * (height - top - bottom);
  const picture = svg('svg', { viewBox: `0 0 ${width} ${height}`, width, height, role: 'img', 'aria-label': 'Histogram of the errors on held-out shapes' });
  for (const [style, , values] of curves) {
    const corners = values.flatMap((v, i) => [[edges[first + i], v], [edges[first + i + 1], v]]);
    picture.append(svg('polygon', { class: style, points: [[edges[first], 0], ...corners, [edges[last], 0]].map(([a, b]) => `${x(a).toFixed(1)},${y(b).toFixed(1)}`).join(' ') }));
  }
  for (const tick of logTicks(edges[first], edges[last])) picture.append(svg('text', { x: x(tick), y: height - bottom + 18, 'text-anchor': 'middle' }, numberText(tick)));
  picture.append(svg('line', { class: 'axis', x1: left, x2: width - right, y1: y(0), y2: y(0) }),
    svg('text', { x: width - right, y: height - 6, 'text-anchor': 'end' }, `error, mm, of ${shapes} shapes`), svg('text', { x: left, y: 12 }, `${numberText(100 * most, 2)} % of the voxels`));
  $('histogram').append(picture, element('p', { class: 'legend' }, ...curves.map(([style, title]) => element('span', { class: 'key ' + style }, title))));
}
