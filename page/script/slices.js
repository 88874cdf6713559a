// Slices of the map: colours between the voxels, and contours by marching squares.
const AXES = ['x', 'y', 'z'];

// The distance between contours: about seven between 0 and `reach` (mm), at 1, 2 or 5 times a power of ten.
function contourStep(reach) {
  const power = 10 ** Math.floor(Math.log10(reach / 7));
  return power * [1, 2, 5, 10].find(k => k * power >= reach / 7);
}

// The slice of values[nz][ny][nx] across an axis: {data, width, height}, x or y to the right.
function sliceOf(values, size, axis, index) {
  const [nx, ny, nz] = size;
  const width = axis === 0 ? ny : nx, height = axis === 2 ? ny : nz;
  const data = new Float32Array(width * height);
  for (let row = 0; row < height; row++) {
    for (let column = 0; column < width; column++) {
      const [i, j, k] = axis === 0 ? [index, column, row] : axis === 1 ? [column, index, row] : [column, row, index];
      data[row * width + column] = values[(k * ny + j) * nx + i];
    }
  }
  return { data, width, height };
}

// Adds the contour at `level` to the path of a context; place(column, row) gives the point on the canvas.
function traceContour(context, { data, width, height }, level, place) {
  for (let row = 0; row + 1 < height; row++) {
    for (let column = 0; column + 1 < width; column++) {
      const at = row * width + column;
      const v = [data[at] - level, data[at + 1] - level, data[at + width + 1] - level, data[at + width] - level];
      const corner = [[column, row], [column + 1, row], [column + 1, row + 1], [column, row + 1]];
      const points = [];
      for (let e = 0; e < 4; e++) {
        const f = (e + 1) % 4;
        if (v[e] < 0 === v[f] < 0) continue;
        const share = v[e] / (v[e] - v[f]);
        points.push(place(corner[e][0] + share * (corner[f][0] - corner[e][0]), corner[e][1] + share * (corner[f][1] - corner[e][1])));
      }
      // four crossings: the mean of the corners says which are joined
      if (points.length === 4 && v[0] < 0 !== v[0] + v[1] + v[2] + v[3] < 0) points.push(points.shift());
      for (let p = 0; p + 1 < points.length; p += 2) {
        context.moveTo(...points[p]);
        context.lineTo(...points[p + 1]);
      }
    }
  }
}

const COLOURS = 512;

// The colours of distances from -reach to reach (mm), as words of an image.
function colourTable() {
  const deep = colour('--deep'), inside = colour('--inside'), near = colour('--near'), far = colour('--far');
  const bytes = new Uint8Array(4 * COLOURS);
  for (let i = 0; i < COLOURS; i++) {
    const d = (i + 0.5) / COLOURS * 2 - 1, share = Math.abs(d) ** 0.8, [from, to] = d < 0 ? [inside, deep] : [near, far];
    for (let c = 0; c < 3; c++) bytes[4 * i + c] = Math.round(255 * (from[c] + (to[c] - from[c]) * share));
    bytes[4 * i + 3] = 255;
  }
  return new Uint32Array(bytes.buffer);
}

// An image of the slice with `scale` pixels a voxel, linear between the voxels.
function paint({ data, width, height }, reach, scale, flipped) {
  const image = new ImageData(Math.round(width * scale), Math.round(height * scale));
  const words = new Uint32Array(image.data.buffer), table = colourTable(), factor = COLOURS / (2 * reach);
  const left = new Int32Array(image.width), share = new Float32Array(image.width);
  for (let x = 0; x < image.width; x++) {
    const at = Math.min(Math.max((x + 0.5) / scale - 0.5, 0), width - 1);
    left[x] = Math.min(Math.floor(at), Math.max(width - 2, 0));
    share[x] = at - left[x];
  }
  const step = width > 1 ? 1 : 0;
  for (let y = 0; y < image.height; y++) {
    const shown = Math.min(Math.max((y + 0.5) / scale - 0.5, 0), height - 1), at = flipped ? height - 1 - shown : shown;
    const row = Math.min(Math.floor(at), Math.max(height - 2, 0)), part = at - row;
    const low = row * width, high = height > 1 ? low + width : low;
    for (let x = 0; x < image.width; x++) {
      const a = left[x], b = a + step, t = share[x];
      const upper = data[low + a] + t * (data[low + b] - data[low + a]), lower = data[high + a] + t * (data[high + b] - data[high + a]);
      const index = (upper + part * (lower - upper) + reach) * factor;
      words[y * image.width + x] = table[index < 0 ? 0 : index >= COLOURS ? COLOURS - 1 : index | 0];
    }
  }
  return image;
}

// The view of the slice across `axis`. moved(axis, index) is called when another slice is asked for, pointed(position) for a point: indices of
// the other two axes, null for this one; watched(axis) when the reader turns to this slice, watched(null) when not any more.
function createSliceView(axis, grid, { moved, pointed, watched }) {
  const [right, up] = [[1, 2], [0, 2], [0, 1]][axis];
  const flipped = up === 2; // z upwards; y (to the back) downwards, as radiologists look
  const canvas = element('canvas', { role: 'img' });
  const range = element('input', { type: 'range', min: 0, max: grid.size[axis] - 1, step: 1, 'aria-label': `Slice across ${AXES[axis]}` });
  const label = element('output');
  const figure = element('figure', {}, canvas, element('figcaption', {}, label, range));
  figure.style.setProperty('--shape', `${grid.size[right] * grid.spacing[right]} / ${grid.size[up] * grid.spacing[up]}`);
  figure.style.flexGrow = grid.size[right] * grid.spacing[right] / (grid.size[up] * grid.spacing[up]);
  const buffer = document.createElement('canvas');
  let last = null;

  const toRow = row => (flipped ? grid.size[up] - 1 - row : row);

  function draw() {
    if (!last) return;
    const { slice, position, reach } = last;
    const ratio = fitCanvas(canvas), context = canvas.getContext('2d');
    const place = (column, row) => [(column + 0.5) / slice.width * canvas.width, (toRow(row) + 0.5) / slice.height * canvas.height];
    const image = paint(slice, reach, Math.min(canvas.width / slice.width, 8), flipped);
    Object.assign(buffer, { width: image.width, height: image.height });
    buffer.getContext('2d').putImageData(image, 0, 0);
    context.drawImage(buffer, 0, 0, canvas.width, canvas.height);
    const contour = (levels, style, width) => {
      context.beginPath();
      for (const level of levels) traceContour(context, slice, level, place);
      Object.assign(context, { strokeStyle: style, lineWidth: width * ratio, lineCap: 'round' });
      context.stroke();
    };
    const step = contourStep(reach), levels = [];
    for (let k = 1; k * step <= reach * 1.5; k++) levels.push(k * step, -k * step);
    contour(levels, cssColour(colour('--faint'), 0.35), 0.75);
    contour([0], cssColour(colour('--contour')), 2);
    // where the other two slices are
    const [x, y] = place(position[right], position[up]);
    context.beginPath();
    context.moveTo(x, 0);
    context.lineTo(x, canvas.height);
    context.moveTo(0, y);
    context.lineTo(canvas.width, y);
    Object.assign(context, { strokeStyle: cssColour(colour('--ink'), 0.16), lineWidth: ratio });
    context.stroke();
  }

  // Shows a slice; position[3]: indices of the three slices; reach: distance (mm) of the last colour.
  function show(slice, position, reach) {
    last = { slice, position, reach };
    const mm = grid.origin[axis] + position[axis] * grid.spacing[axis];
    label.value = grid.straight ? `${AXES[axis]} = ${numberText(Math.round(mm * 100) / 100, 4)} mm` : `slice ${position[axis] + 1} of ${grid.size[axis]}`;
    canvas.setAttribute('aria-label', `Slice across ${AXES[axis]} of the map, ${label.value}`);
    range.value = position[axis];
    draw();
  }

  function point(event) {
    const box = canvas.getBoundingClientRect(), position = [null, null, null];
    const index = (share, n) => Math.min(Math.max(Math.floor(share * n), 0), n - 1);
    position[right] = index((event.clientX - box.left) / box.width, grid.size[right]);
    position[up] = toRow(index((event.clientY - box.top) / box.height, grid.size[up]));
    pointed(position);
  }
  if (moved) {
    range.addEventListener('input', () => moved(axis, Number(range.value)));
    canvas.addEventListener('pointerdown', event => {
      canvas.setPointerCapture(event.pointerId);
      point(event);
    });
    canvas.addEventListener('pointermove', event => { if (event.buttons) point(event); });
  } else {
    range.hidden = true;
  }
  for (const name of ['pointerenter', 'focusin']) figure.addEventListener(name, () => watched(axis));
  for (const name of ['pointerleave', 'focusout']) figure.addEventListener(name, () => watched(null));
  onChange(canvas, draw);
  return { figure, show };
}
