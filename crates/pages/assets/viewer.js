// Surfaces to turn. The camera is that of the crate `render`: azimuth and elevation about the
// upward axis, its distance that of an angle of view of 22 degrees for the ball around all surfaces
// of a viewer. Together they fill the first view.
const FIELD_OF_VIEW = (22 * Math.PI) / 180;
const DEGREE = Math.PI / 180;
// Of the eye from the centre of the ball, in units of its radius.
const DISTANCE = 1.08 / Math.sin(FIELD_OF_VIEW / 2);
// Part of a side of the view that the surfaces take.
const FILLED = 0.95;

const VERTEX_SHADER = `
attribute vec3 position;
attribute vec3 normal;
uniform mat4 camera;
varying vec3 n;
void main() {
  n = normal;
  gl_Position = camera * vec4(position, 1.0);
}`;

// A key light and a fill light that move with the camera, light from above, a faint gloss; linear
// light is turned into sRGB at the end.
const FRAGMENT_SHADER = `
precision highp float;
uniform vec3 right, above, toward;
varying vec3 n;
void main() {
  vec3 world = normalize(n);
  vec3 m = vec3(dot(world, right), dot(world, above), dot(world, toward));
  if (!gl_FrontFacing) m = -m;
  vec3 key = normalize(vec3(-0.45, 0.65, 0.75));
  vec3 fill = normalize(vec3(0.8, 0.1, 0.5));
  float light = 0.58 * max(dot(m, key), 0.0) + 0.2 * max(dot(m, fill), 0.0) + 0.3 + 0.1 * m.y;
  float gloss = 0.05 * pow(max(dot(m, normalize(key + vec3(0.0, 0.0, 1.0))), 0.0), 24.0);
  vec3 linear = vec3(0.88, 0.8, 0.69) * light + gloss;
  gl_FragColor = vec4(pow(clamp(linear, 0.0, 1.0), vec3(1.0 / 2.2)), 1.0);
}`;

// The reverse of surface.rs.
function decodeSurface(block, centre) {
  const text = atob(block.textContent);
  const bytes = Uint8Array.from(text, (c) => c.charCodeAt(0));
  const numbers = (list) => list.split(" ").map(Number);
  const { vertices, faces, low, step } = block.dataset;
  const [origin, unit] = [numbers(low), numbers(step)];
  const positions = new Float32Array(3 * Number(vertices));
  for (let k = 0; k < positions.length; k++) {
    // Relative to the centre: far from the origin single precision would not do.
    positions[k] = origin[k % 3] - centre[k % 3] + unit[k % 3] * (bytes[2 * k] | (bytes[2 * k + 1] << 8));
  }
  let at = 2 * positions.length;
  const given = "normals" in block.dataset;
  const normals = new Float32Array(positions.length);
  for (let k = 0; given && k < normals.length; k++, at += 2) {
    normals[k] = (2 * (bytes[at] | (bytes[at + 1] << 8))) / 65535 - 1;
  }
  const corners = new Uint32Array(3 * Number(faces));
  let next = 0;
  for (let k = 0; k < corners.length; k++) {
    let distance = 0;
    let shift = 0;
    let byte;
    do {
      byte = bytes[at++];
      distance |= (byte & 127) << shift;
      shift += 7;
    } while (byte & 128);
    corners[k] = next - distance;
    if (distance === 0) next++;
  }
  if (at !== bytes.length || next !== Number(vertices)) {
    throw new Error("the data of the surface " + block.dataset.label + " are damaged");
  }
  return { positions, corners, normals: given ? normals : smoothNormals(positions, corners) };
}

const along = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

// Where right, above and toward the eye are, seen from a direction.
function directions(up, azimuth, elevation) {
  const axis = (k) => [0, 1, 2].map((i) => (i === k % 3 ? 1 : 0));
  const [u, a, b] = [axis(up), axis(up + 1), axis(up + 2)];
  const [sa, ca, se, ce] = [Math.sin(azimuth), Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation)];
  const horizontal = [0, 1, 2].map((i) => ca * a[i] + sa * b[i]);
  return {
    right: [0, 1, 2].map((i) => ca * b[i] - sa * a[i]),
    above: [0, 1, 2].map((i) => ce * u[i] - se * horizontal[i]),
    toward: [0, 1, 2].map((i) => ce * horizontal[i] + se * u[i]),
  };
}

// The middle of the outline as it is seen, in slopes against the axis of view, and the focal length with which it fills a view
// whose sides have these lengths in units of the shorter one.
function framed(outline, { right, above, toward }, sides) {
  const [low, high] = [[Infinity, Infinity], [-Infinity, -Infinity]];
  for (const point of outline) {
    const depth = DISTANCE - along(point, toward);
    [along(point, right) / depth, along(point, above) / depth].forEach((slope, i) => {
      low[i] = Math.min(low[i], slope);
      high[i] = Math.max(high[i], slope);
    });
  }
  const focal = [0, 1].map((i) => (2 * FILLED * sides[i]) / Math.max(high[i] - low[i], 1e-9));
  return { middle: [0, 1].map((i) => (low[i] + high[i]) / 2), focal: Math.min(...focal) };
}

// Sums over the faces around a vertex; the cross product weighs them by area.
function smoothNormals(positions, corners) {
  const normals = new Float32Array(positions.length);
  for (let k = 0; k < corners.length; k += 3) {
    const [a, b, c] = [3 * corners[k], 3 * corners[k + 1], 3 * corners[k + 2]];
    const u = [0, 1, 2].map((i) => positions[b + i] - positions[a + i]);
    const v = [0, 1, 2].map((i) => positions[c + i] - positions[a + i]);
    for (let i = 0; i < 3; i++) {
      const [j, l] = [(i + 1) % 3, (i + 2) % 3];
      const value = u[j] * v[l] - u[l] * v[j];
      normals[a + i] += value;
      normals[b + i] += value;
      normals[c + i] += value;
    }
  }
  for (let k = 0; k < normals.length; k += 3) {
    const length = Math.hypot(normals[k], normals[k + 1], normals[k + 2]) || 1;
    for (let i = 0; i < 3; i++) normals[k + i] /= length;
  }
  return normals;
}

class SurfaceViewer {
  constructor(figure) {
    this.figure = figure;
    this.stage = figure.querySelector(".stage");
    this.blocks = [...figure.querySelectorAll("script[data-vertices]")];
    // All surfaces are framed by one ball: nothing jumps from step to step.
    this.ball = {
      centre: figure.dataset.centre.split(" ").map(Number),
      radius: Number(figure.dataset.radius),
    };
    const outline = figure.dataset.outline.split(" ").map(Number);
    this.outline = Array.from({ length: outline.length / 3 }, (_, k) => outline.slice(3 * k, 3 * k + 3));
    this.surfaces = new Map();
    this.step = 0;
    this.reset();
    this.button = document.createElement("button");
    this.button.type = "button";
    this.button.className = "start";
    this.button.textContent = "Turn in 3D";
    this.button.addEventListener("click", () => this.start() && this.canvas.focus());
    this.stage.after(this.button);
  }

  reset() {
    this.azimuth = Number(this.figure.dataset.azimuth) * DEGREE;
    this.elevation = Number(this.figure.dataset.elevation) * DEGREE;
    this.zoom = 1;
  }

  // Replaces the picture by the surface; false, and a line of text, if that is not possible.
  start() {
    if (this.gl) return true;
    this.canvas = document.createElement("canvas");
    try {
      this.gl = this.canvas.getContext("webgl2") || this.canvas.getContext("webgl");
      if (!this.gl) throw new Error("this browser has no WebGL");
      this.prepare();
      this.listen();
      this.select(0);
    } catch (error) {
      this.fail(error.message);
      return false;
    }
    this.button.remove();
    this.stage.classList.add("running");
    this.stage.append(this.canvas);
    if (this.blocks.length > 1) {
      const labels = this.blocks.map((block) => block.dataset.label);
      this.show = addControls(this.figure, labels, (k) => this.select(k));
    }
    new ResizeObserver(() => this.request()).observe(this.canvas);
    return true;
  }

  fail(reason) {
    this.gl = null;
    this.canvas.remove();
    this.stage.classList.remove("running");
    this.button.remove();
    this.figure.querySelector(".controls")?.remove();
    const note = document.createElement("p");
    note.className = "note";
    note.textContent = "The surface cannot be turned: " + reason + ".";
    this.stage.after(note);
  }

  prepare() {
    const gl = this.gl;
    // WebGL 1 has large indices as an extension only.
    if (!(window.WebGL2RenderingContext && gl instanceof WebGL2RenderingContext)) {
      if (!gl.getExtension("OES_element_index_uint")) throw new Error("its WebGL is too old");
    }
    this.program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, VERTEX_SHADER], [gl.FRAGMENT_SHADER, FRAGMENT_SHADER]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
    }
    gl.bindAttribLocation(this.program, 0, "position");
    gl.bindAttribLocation(this.program, 1, "normal");
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS)) throw new Error("its shaders do not compile");
    gl.useProgram(this.program);
    gl.enable(gl.DEPTH_TEST);
    this.uniforms = Object.fromEntries(
      ["camera", "right", "above", "toward"].map((name) => [name, gl.getUniformLocation(this.program, name)]),
    );
  }

  // Buffers are made when a surface is first shown.
  select(k) {
    const gl = this.gl;
    if (!gl) return;
    this.step = k;
    if (!this.surfaces.has(k)) {
      const { positions, normals, corners } = decodeSurface(this.blocks[k], this.ball.centre);
      const buffer = (target, data) => {
        const made = gl.createBuffer();
        gl.bindBuffer(target, made);
        gl.bufferData(target, data, gl.STATIC_DRAW);
        return made;
      };
      this.surfaces.set(k, {
        positions: buffer(gl.ARRAY_BUFFER, positions),
        normals: buffer(gl.ARRAY_BUFFER, normals),
        corners: buffer(gl.ELEMENT_ARRAY_BUFFER, corners),
        count: corners.length,
      });
    }
    this.request();
  }

  request() {
    if (this.requested) return;
    this.requested = true;
    requestAnimationFrame(() => {
      this.requested = false;
      this.draw();
    });
  }

  draw() {
    const { gl, canvas, ball, uniforms } = this;
    if (!gl) return;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) =>
      Math.max(1, Math.round(side * Math.min(window.devicePixelRatio || 1, 2))),
    );
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);

    const shorter = Math.min(width, height);
    const sides = [width / shorter, height / shorter];
    const up = Number(this.figure.dataset.up);
    const { azimuth, elevation } = this.figure.dataset;
    const first = framed(this.outline, directions(up, azimuth * DEGREE, elevation * DEGREE), sides);
    const seen = directions(up, this.azimuth, this.elevation);
    const { right, above, toward } = seen;
    const frame = framed(this.outline, seen, sides);
    // As large as in the first view, but where it would be cut off as it is turned.
    const focal = this.zoom * Math.min(first.focal, frame.focal);
    const [fx, fy] = sides.map((side) => focal / side);

    // In units of the ball's radius it lies between the planes at `DISTANCE - 1` and `DISTANCE + 1`.
    const [near, far] = [DISTANCE - 1.05, DISTANCE + 1.05];
    const depth = [(far + near) / (far - near), (-2 * far * near) / (far - near)];
    const row = (direction, scale) => [...direction, 0].map((v) => (scale * v) / ball.radius);
    const [x, y, z] = [row(right, fx), row(above, fy), row(toward, -1)];
    z[3] += DISTANCE; // Now the distance in front of the eye.
    z.forEach((v, i) => {
      x[i] -= fx * frame.middle[0] * v;
      y[i] -= fy * frame.middle[1] * v;
    });
    const rows = [x, y, z.map((v, i) => depth[0] * v + (i === 3 ? depth[1] : 0)), z];
    const columns = [0, 1, 2, 3].flatMap((c) => rows.map((r) => r[c]));
    gl.uniformMatrix4fv(uniforms.camera, false, columns);
    gl.uniform3fv(uniforms.right, right);
    gl.uniform3fv(uniforms.above, above);
    gl.uniform3fv(uniforms.toward, toward);

    const surface = this.surfaces.get(this.step);
    [surface.positions, surface.normals].forEach((buffer, k) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(k);
      gl.vertexAttribPointer(k, 3, gl.FLOAT, false, 0, 0);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, surface.corners);
    gl.drawElements(gl.TRIANGLES, surface.count, gl.UNSIGNED_INT, 0);
  }

  turn(azimuth, elevation) {
    this.azimuth += azimuth;
    const limit = Math.PI / 2;
    this.elevation = Math.min(limit, Math.max(-limit, this.elevation + elevation));
    this.request();
  }

  scale(factor) {
    this.zoom = Math.min(8, Math.max(0.4, this.zoom * factor));
    this.request();
  }

  listen() {
    const { canvas } = this;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "application");
    canvas.setAttribute(
      "aria-label",
      this.figure.dataset.caption + ". Drag or use the arrow keys to turn, plus and minus to zoom, 0 to reset.",
    );
    canvas.addEventListener("webglcontextlost", () => this.fail("the graphics card gave up"));
    // Pointers that are down, with where they were last: one turns, two zoom.
    const down = new Map();
    const spread = () => {
      const [p, q] = [...down.values()];
      return Math.hypot(p.x - q.x, p.y - q.y) || 1;
    };
    canvas.addEventListener("pointerdown", (event) => {
      down.set(event.pointerId, { x: event.clientX, y: event.clientY });
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      const last = down.get(event.pointerId);
      if (!last) return;
      const before = down.size === 2 ? spread() : 0;
      const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
      Object.assign(last, { x: event.clientX, y: event.clientY });
      if (down.size === 1) this.turn(-0.008 * dx, 0.008 * dy);
      else if (down.size === 2) this.scale(spread() / before);
    });
    for (const end of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(end, (event) => down.delete(event.pointerId));
    }
    // Only after a click: pages must scroll across a viewer.
    canvas.addEventListener(
      "wheel",
      (event) => {
        if (document.activeElement !== canvas) return;
        event.preventDefault();
        this.scale(Math.exp(-Math.sign(event.deltaY) * 0.12));
      },
      { passive: false },
    );
    const initial = () => {
      this.reset();
      this.request();
    };
    canvas.addEventListener("dblclick", initial);
    const keys = {
      ArrowLeft: () => this.turn(0.1, 0),
      ArrowRight: () => this.turn(-0.1, 0),
      ArrowUp: () => this.turn(0, 0.1),
      ArrowDown: () => this.turn(0, -0.1),
      "+": () => this.scale(1.15),
      "-": () => this.scale(1 / 1.15),
      0: initial,
      Home: initial,
    };
    canvas.addEventListener("keydown", (event) => {
      const action = keys[event.key];
      if (!action || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      action();
    });
  }
}

const viewers = [...document.querySelectorAll("figure.viewer")].map((figure) => new SurfaceViewer(figure));
