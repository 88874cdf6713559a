// Slices of the map: colours and contours between the voxels; the surface by marching squares.
const AXES = ['x', 'y', 'z'];
const SIDES = [[1, 2], [0, 2], [0, 1]]; // the axes to the right and up in the slice across each axis

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

// Adds the contour at 0 to the path of a context; x[column] and y[row]: the places of the voxels on the canvas.
function traceContour(context, { data, width, height }, x, y) {
  const points = new Float64Array(8);
  for (let row = 0; row + 1 < height; row++) {
    for (let column = 0; column + 1 < width; column++) {
      const at = row * width + column, a = data[at], b = data[at + 1], c = data[at + width + 1], d = data[at + width];
      if (a < 0 === b < 0 && b < 0 === c < 0 && c < 0 === d < 0) continue;
      const left = x[column], right = x[column + 1], low = y[row], high = y[row + 1];
      let n = 0;
      // a crossing of the edge from a corner with value p to one with value q
      const cross = (p, q, fromX, fromY, toX, toY) => {
        if (p < 0 === q < 0) return;
        const share = p / (p - q);
        points[n++] = fromX + share * (toX - fromX);
        points[n++] = fromY + share * (toY - fromY);
      };
      cross(a, b, left, low, right, low);
      cross(b, c, right, low, right, high);
      cross(c, d, right, high, left, high);
      cross(d, a, left, high, left, low);
      // four crossings: the mean of the corners says which are joined
      const turned = n === 8 && a < 0 !== a + b + c + d < 0 ? 2 : 0;
      for (let i = 0; i < n; i += 4) {
        context.moveTo(points[(i + turned) % n], points[(i + turned + 1) % n]);
        context.lineTo(points[(i + turned + 2) % n], points[(i + turned + 3) % n]);
      }
    }
  }
}

const COLOURS = 4096;
const TABLE_REACH = 1.5; // the table goes from -1.5 reach to 1.5 reach
const sliceColours = colours('deep', 'inside', 'near', 'far', 'faint', 'ink');

// The colours of distances, as words of an image. Contours are lines in the table, of the width of a pixel (mm): the slope of a distance is 1.
function colourTable(reach, pixel) {
  const { deep, inside, near, far, faint } = sliceColours(), step = contourStep(reach), size = TABLE_REACH * reach;
  const bytes = new Uint8Array(4 * COLOURS);
  for (let i = 0; i < COLOURS; i++) {
    const d = ((i + 0.5) / COLOURS * 2 - 1) * size, share = Math.min(Math.abs(d) / reach, 1) ** 0.8, [from, to] = d < 0 ? [inside, deep] : [near, far];
    const level = Math.round(d / step), line = level === 0 ? 0 : Math.min(Math.max(1 - Math.abs(d - level * step) / pixel, 0), 1);
    for (let c = 0; c < 3; c++) {
      const plain = from[c] + (to[c] - from[c]) * share;
      bytes[4 * i + c] = Math.round(255 * (plain + 0.35 * line * (faint[c] - plain)));
    }
    bytes[4 * i + 3] = 255;
  }
  return new Uint32Array(bytes.buffer);
}

// For each pixel of a line over n voxels: the voxel before it and its share of the way to the next; fine: of voxels this much shorter.
function pixelPlaces(pixels, n, flipped, fine = 1) {
  const low = new Int32Array(pixels), share = new Float32Array(pixels);
  for (let i = 0; i < pixels; i++) {
    const along = Math.min(Math.max((i + 0.5) / pixels * n - 0.5, 0), n - 1), at = fine * (flipped ? n - 1 - along : along);
    low[i] = Math.min(Math.floor(at), Math.max(fine * (n - 1) - 1, 0));
    share[i] = at - low[i];
  }
  return { low, share };
}

// Paints slices of one size on images of one size, linear between the voxels. pixel: mm.
function createPainter(columns, rows, width, height, flipped, reach, pixel) {
  const image = new ImageData(width, height), words = new Uint32Array(image.data.buffer);
  const table = colourTable(reach, pixel), factor = COLOURS / (2 * TABLE_REACH * reach), zero = COLOURS / 2;
  const across = pixelPlaces(width, columns, false), down = pixelPlaces(height, rows, flipped);
  const wide = new Float32Array(rows * width), step = columns > 1 ? 1 : 0;
  return data => {
    for (let row = 0; row < rows; row++) {
      const from = row * columns, to = row * width;
      for (let x = 0; x < width; x++) {
        const a = data[from + across.low[x]], b = data[from + across.low[x] + step];
        wide[to + x] = (a + across.share[x] * (b - a)) * factor + zero;
      }
    }
    for (let y = 0; y < height; y++) {
      const low = down.low[y] * width, high = rows > 1 ? low + width : low, part = down.share[y], to = y * width;
      for (let x = 0; x < width; x++) {
        const a = wide[low + x], index = a + part * (wide[high + x] - a);
        words[to + x] = table[index < 0 ? 0 : index >= COLOURS ? COLOURS - 1 : index | 0];
      }
    }
    return image;
  };
}

const PIXELS_OF_VOXEL = 8; // at most; larger pictures are stretched
const UNSEEN_REST = 250; // ms
const MOVING_SLICES = 0.5; // share of the pixels along a side while slices change on a machine without a graphics card
// The processor makes the pixels and draws the contours: on canvases of the graphics card the same takes longer, most of all without a card.
const SOFTWARE = { willReadFrequently: true };

// The view of the slice across `axis`. moved(axis, index) is called when another slice is asked for, pointed(position) for a point: indices of
// the other two axes, null for this one; watched(axis) when the reader turns to this slice, watched(null) when not any more.
// backdrop(axis, index, width, height, flipped, pixel): of a page of a fit, the picture behind the contours; null: colours of the distance.
function createSliceView(axis, grid, { moved, pointed, watched, backdrop }) {
  const [right, up] = SIDES[axis];
  const flipped = up === 2; // z upwards; y (to the back) downwards, as radiologists look
  const canvas = element('canvas', { role: 'img' });
  const range = element('input', { type: 'range', min: 0, max: grid.size[axis] - 1, step: 1, 'aria-label': `Slice across ${AXES[axis]}` });
  const label = element('output');
  const figure = element('figure', {}, canvas, element('figcaption', {}, label, range));
  figure.style.setProperty('--shape', `${grid.size[right] * grid.spacing[right]} / ${grid.size[up] * grid.spacing[up]}`);
  figure.style.flexGrow = grid.size[right] * grid.spacing[right] / (grid.size[up] * grid.spacing[up]);
  const context = canvas.getContext('2d', SOFTWARE), buffer = document.createElement('canvas'), columns = grid.size[right], rows = grid.size[up];
  const tools = new Map(); // see prepare(), by the width of the canvas
  let last = null, seen = false, later = 0, share = 1, resting = 0;

  const toRow = row => (flipped ? rows - 1 - row : row);

  // What depends on the size of the canvas and on the colours: {painter, x, y, width, height}, size of the image of the painter.
  function prepare(reach) {
    const part = Math.min(1, PIXELS_OF_VOXEL * columns / canvas.width);
    const width = Math.round(canvas.width * part), height = Math.max(1, Math.round(canvas.height * part)), pixel = columns * grid.spacing[right] / width;
    const made = {
      width, height,
      painter: backdrop ? createBackdrop(width, height, pixel) : createPainter(columns, rows, width, height, flipped, reach, pixel),
      x: Float64Array.from({ length: columns }, (_, column) => (column + 0.5) / columns * canvas.width),
      y: Float64Array.from({ length: rows }, (_, row) => (toRow(row) + 0.5) / rows * canvas.height)
    };
    tools.set(canvas.width, made);
    return made;
  }

  // The picture behind the contours, made again only for another slice.
  function createBackdrop(width, height, pixel) {
    let made = null, of = -1;
    return (_, index) => {
      if (of !== index) made = backdrop(axis, index, width, height, flipped, pixel);
      of = index;
      return made;
    };
  }

  function contour(slice, { x, y }, style, width) {
    context.beginPath();
    traceContour(context, slice, x, y);
    Object.assign(context, { strokeStyle: style, lineWidth: width, lineCap: 'round' });
    context.stroke();
  }

  // Draws at once while the reader sees the slice, otherwise when the sliders rest.
  function drawSoon() {
    clearTimeout(later);
    clearTimeout(resting);
    if (seen && !graphicsCard) {
      share = MOVING_SLICES;
      resting = setTimeout(() => {
        share = 1;
        draw();
      }, UNSEEN_REST);
    }
    if (seen) draw();
    else later = setTimeout(draw, UNSEEN_REST);
  }

  function draw() {
    clearTimeout(later);
    if (!last) return;
    const { slice, position, reach, fitted } = last, ratio = sized(share), tool = tools.get(canvas.width) ?? prepare(reach), { x, y, width, height } = tool;
    const picture = tool.painter(slice.data, position[axis]);
    if (width === canvas.width) {
      context.putImageData(picture, 0, 0);
    } else {
      if (buffer.width !== width || buffer.height !== height) Object.assign(buffer, { width, height });
      buffer.getContext('2d', SOFTWARE).putImageData(picture, 0, 0);
      context.drawImage(buffer, 0, 0, canvas.width, canvas.height);
    }
    if (fitted) contour(fitted, tool, cssColour(colour('--fitted')), 1.5 * ratio);
    if (fitted !== slice) contour(slice, tool, cssColour(colour(fitted ? '--moved' : '--contour')), 2 * ratio);
    // where the other two slices are
    context.beginPath();
    context.moveTo(x[position[right]], 0);
    context.lineTo(x[position[right]], canvas.height);
    context.moveTo(0, y[position[up]]);
    context.lineTo(canvas.width, y[position[up]]);
    Object.assign(context, { strokeStyle: cssColour(sliceColours().ink, 0.16), lineWidth: ratio });
    context.stroke();
  }

  const sized = onChange(canvas, () => {
    tools.clear();
    draw();
  });
  new IntersectionObserver(entries => {
    seen = entries.at(-1).isIntersecting;
    if (seen) draw();
  }, { rootMargin: '100px' }).observe(canvas);

  // Shows a slice; position[3]: indices of the three slices; reach: distance (mm) of the last colour; fitted: the same slice of the fit, null: none.
  function show(slice, position, reach, fitted = null) {
    last = { slice, position, reach, fitted };
    const mm = grid.origin[axis] + position[axis] * grid.spacing[axis];
    const place = grid.straight ? `${AXES[axis]} = ${numberText(Math.round(mm * 100) / 100, 4)} mm` : `slice ${position[axis] + 1} of ${grid.size[axis]}`;
    if (label.value !== place) {
      label.value = place;
      canvas.setAttribute('aria-label', `Slice across ${AXES[axis]} of the map, ${place}`);
      range.value = position[axis];
    }
    drawSoon();
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
  return { figure, show };
}
