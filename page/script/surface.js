// The surface, drawn by WebGL2: turned by dragging or by the arrow keys, about the z axis of the shape and the horizontal.
// The colour of the surface: m: normal, eye: direction to the eye.
const LIGHT = `
uniform vec3 front, back, sky;
vec3 lit(vec3 m, vec3 eye, vec3 base) {
  vec3 light = normalize(vec3(-0.45, 0.65, 0.75));
  float key = max(dot(m, light), 0.0), fill = 0.5 + 0.5 * m.y;
  float shine = pow(max(dot(m, normalize(light + eye)), 0.0), 42.0);
  float rim = pow(1.0 - max(dot(m, eye), 0.0), 3.0);
  return base * (0.34 + 0.62 * key + 0.24 * fill) + 0.16 * shine + rim * sky * 0.28;
}`;

const VERTEX_HEAD = `#version 300 es
uniform mat4 camera;
uniform mat3 turn;
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;`;
const FRAGMENT_HEAD = `#version 300 es
precision highp float;
out vec4 result;`;

// Light at each pixel.
const FINE_SHADERS = [VERTEX_HEAD + `
out vec3 n;
out vec3 view;
void main() {
  n = turn * normal;
  gl_Position = camera * vec4(position, 1.0);
  view = vec3(gl_Position.xy / gl_Position.w * 0.25, -1.0);
}`, FRAGMENT_HEAD + LIGHT + `
uniform float shaded;
in vec3 n;
in vec3 view;
void main() {
  if (shaded < 0.5) { result = vec4(front, 1.0); return; }
  vec3 m = normalize(n), eye = normalize(-view);
  result = vec4(gl_FrontFacing ? lit(m, eye, front) : lit(-m, eye, back), 1.0);
}`];

// Light at the vertices of a surface that is seen from outside, for drawing by software: a triangle has few pixels.
const QUICK_SHADERS = [VERTEX_HEAD + LIGHT + `
out vec3 colour;
void main() {
  gl_Position = camera * vec4(position, 1.0);
  colour = lit(normalize(turn * normal), normalize(vec3(gl_Position.xy / gl_Position.w * -0.25, 1.0)), front);
}`, FRAGMENT_HEAD + `
in vec3 colour;
void main() { result = vec4(colour, 1.0); }`];

// A program and the places of its uniforms: {program, camera, turn, ...}.
function surfaceProgram(gl, texts) {
  const program = gl.createProgram();
  [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((type, i) => {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, texts[i]);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  });
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
  const names = ['camera', 'turn', 'front', 'back', 'sky', 'shaded'];
  return { program, ...Object.fromEntries(names.map(name => [name, gl.getUniformLocation(program, name)])) };
}

// The camera: matrices in the order of columns. yaw, pitch: rad; zoom 1 shows a ball of this radius around the centre.
function cameraMatrices(yaw, pitch, zoom, centre, radius, aspect) {
  const cy = Math.cos(yaw), sy = Math.sin(yaw), cp = Math.cos(pitch), sp = Math.sin(pitch);
  // rows: to the right, up, towards the eye
  const right = [cy, sy, 0], up = [-sp * sy, sp * cy, cp], eye = [cp * sy, -cp * cy, sp];
  const turn = [0, 1, 2].flatMap(i => [right[i], up[i], eye[i]]);
  const slope = 0.25, distance = radius / slope / zoom / Math.min(1, aspect) * 1.02;
  const near = Math.max(distance - 2 * radius, distance * 0.02), far = distance + 2 * radius;
  const dot = row => row[0] * centre[0] + row[1] * centre[1] + row[2] * centre[2];
  const fx = 1 / (slope * aspect), fy = 1 / slope, a = (far + near) / (far - near), b = 2 * far * near / (far - near);
  const camera = [];
  for (let i = 0; i < 3; i++) camera.push(fx * right[i], fy * up[i], -a * eye[i], -eye[i]);
  camera.push(-fx * dot(right), -fy * dot(up), a * (dot(eye) + distance) - b, dot(eye) + distance);
  return { camera, turn };
}

// Area-weighted normals for vertices without them: [n][3] -> [n][6].
function withNormals(positions, triangles) {
  const n = positions.length / 3, out = new Float32Array(6 * n);
  for (let t = 0; t < triangles.length; t += 3) {
    const [p, q, r] = [0, 1, 2].map(i => 3 * triangles[t + i]);
    const u = [0, 1, 2].map(i => positions[q + i] - positions[p + i]), v = [0, 1, 2].map(i => positions[r + i] - positions[p + i]);
    const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    for (const at of [p, q, r]) for (let i = 0; i < 3; i++) out[2 * at + 3 + i] += normal[i];
  }
  for (let i = 0; i < n; i++) for (let a = 0; a < 3; a++) out[6 * i + a] = positions[3 * i + a];
  return out;
}

// Without a graphics card the browser draws by software: there pictures have fewer pixels and light at the vertices while they change, and when
// they have come to rest so many pixels that edges are smooth, since the smoothing of WebGL itself takes most of the time.
const MOVING_SHARE = 0.5, RESTING_SHARE = 2, REST = 250;
const QUICK_ZOOM = 2; // up to this zoom the eye is outside of twice the radius

function hasGraphicsCard() {
  const gl = document.createElement('canvas').getContext('webgl2', { failIfMajorPerformanceCaveat: true });
  if (!gl) return false;
  // Chromium tells the name by the extension alone, which Firefox advises against
  const named = gl.getParameter(gl.RENDERER) === 'WebKit WebGL' && gl.getExtension('WEBGL_debug_renderer_info');
  const name = gl.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  gl.getExtension('WEBGL_lose_context')?.loseContext();
  return !/swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

const graphicsCard = hasGraphicsCard();

// The view of the surface on a canvas; null without WebGL2. centre (mm) stands in the middle, a ball of `radius` is seen.
function createSurfaceView(canvas, centre, radius) {
  const gl = canvas.getContext('webgl2', { antialias: graphicsCard, alpha: false, preserveDrawingBuffer: true });
  if (!gl) return null;
  const home = { yaw: 0.55, pitch: 0.62, zoom: 1 };
  const at = { ...home };
  const paints = colours('card', 'surface', 'surface-back', 'surface-rim', 'accent');
  let n = 0, whole = false, fine, quick, lines = 0, buffers, frame = 0;
  let share = 1, resting = 0;

  function prepare() {
    fine = surfaceProgram(gl, FINE_SHADERS);
    quick = surfaceProgram(gl, QUICK_SHADERS);
    buffers = { surface: gl.createVertexArray(), frames: gl.createVertexArray(), vertices: gl.createBuffer(), triangles: gl.createBuffer(), lines: gl.createBuffer() };
    gl.bindVertexArray(buffers.surface);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.vertices);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 24, 0);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 3, gl.FLOAT, false, 24, 12);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.triangles);
    gl.bindVertexArray(buffers.frames);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.lines);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 12, 0);
    gl.bindVertexArray(null);
  }

  // Takes a program into use.
  function use(place, front) {
    const { camera, turn } = cameraMatrices(at.yaw, at.pitch, at.zoom, centre, radius, canvas.width / canvas.height), paint = paints();
    gl.useProgram(place.program);
    gl.uniformMatrix4fv(place.camera, false, camera);
    gl.uniformMatrix3fv(place.turn, false, turn);
    gl.uniform3fv(place.front, paint[front]);
    gl.uniform3fv(place.back, paint['surface-back']);
    gl.uniform3fv(place.sky, paint['surface-rim']);
  }

  function drawSurface() {
    // nobody sees the back of a whole surface
    const hurried = share === MOVING_SHARE && whole && at.zoom <= QUICK_ZOOM;
    if (hurried) gl.enable(gl.CULL_FACE);
    use(hurried ? quick : fine, 'surface');
    if (!hurried) gl.uniform1f(fine.shaded, 1);
    gl.bindVertexArray(buffers.surface);
    gl.drawElements(gl.TRIANGLES, n, gl.UNSIGNED_INT, 0);
    gl.disable(gl.CULL_FACE);
  }

  function drawFrames() {
    use(fine, 'accent');
    gl.uniform1f(fine.shaded, 0);
    gl.bindVertexArray(buffers.frames);
    for (let i = 0; i < lines; i += 4) gl.drawArrays(gl.LINE_LOOP, i, 4);
  }

  function draw() {
    cancelAnimationFrame(frame);
    frame = 0;
    sized(share);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(...paints().card, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    drawSurface();
    if (lines) drawFrames();
    gl.bindVertexArray(null);
  }

  // Called before a picture that others may follow soon.
  function move() {
    if (graphicsCard) return;
    share = MOVING_SHARE;
    clearTimeout(resting);
    resting = setTimeout(() => {
      share = RESTING_SHARE;
      drawSoon();
    }, REST);
  }

  // One picture for all that changes before the next frame of the screen.
  function drawSoon() {
    if (!frame) frame = requestAnimationFrame(draw);
  }

  // vertices[n][6]: position and normal; closed: the surface has no edge
  function show(vertices, triangles, closed) {
    gl.bindVertexArray(buffers.surface);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.vertices);
    gl.bufferData(gl.ARRAY_BUFFER, vertices, gl.DYNAMIC_DRAW);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.DYNAMIC_DRAW);
    gl.bindVertexArray(null);
    n = triangles.length;
    whole = closed;
    move();
    draw();
  }

  // The frames of the slices: corners[4 * number of frames][3].
  function showFrames(corners) {
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers.lines);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(corners.flat()), gl.DYNAMIC_DRAW);
    lines = corners.length;
    drawSoon();
  }

  function turnBy(yaw, pitch) {
    move();
    at.yaw -= yaw;
    at.pitch = Math.min(Math.max(at.pitch + pitch, -Math.PI / 2), Math.PI / 2);
    drawSoon();
  }

  function zoomBy(factor) {
    move();
    at.zoom = Math.min(Math.max(at.zoom * factor, 0.4), 8);
    drawSoon();
  }

  function reset() {
    Object.assign(at, home);
    drawSoon();
  }

  const pointers = new Map();
  canvas.addEventListener('pointerdown', event => {
    pointers.set(event.pointerId, event);
    canvas.setPointerCapture(event.pointerId);
  });
  canvas.addEventListener('pointermove', event => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    pointers.set(event.pointerId, event);
    if (pointers.size === 1) {
      turnBy((event.clientX - before.clientX) / 160, (event.clientY - before.clientY) / 160);
    } else {
      const other = [...pointers.values()].find(p => p.pointerId !== event.pointerId);
      const span = p => Math.hypot(p.clientX - other.clientX, p.clientY - other.clientY) + 1;
      zoomBy(span(event) / span(before));
    }
  });
  for (const name of ['pointerup', 'pointercancel']) canvas.addEventListener(name, event => pointers.delete(event.pointerId));
  canvas.addEventListener('dblclick', reset);
  // the wheel scrolls the page unless the view has the focus
  canvas.addEventListener('wheel', event => {
    if (!event.ctrlKey && document.activeElement !== canvas) return;
    event.preventDefault();
    zoomBy(Math.exp(-event.deltaY / 500));
  }, { passive: false });
  canvas.addEventListener('keydown', event => {
    const actions = {
      ArrowLeft: () => turnBy(-0.1, 0), ArrowRight: () => turnBy(0.1, 0), ArrowUp: () => turnBy(0, -0.1), ArrowDown: () => turnBy(0, 0.1),
      '+': () => zoomBy(1.1), '=': () => zoomBy(1.1), '-': () => zoomBy(1 / 1.1), Home: reset
    };
    if (!actions[event.key] || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    actions[event.key]();
  });
  canvas.addEventListener('webglcontextlost', event => event.preventDefault());
  const sized = onChange(canvas, draw);
  prepare();
  return { show, showFrames };
}
