// The surface of a room on a canvas: turn around it, walk in it, and measure between two clicks.
// The triangles are drawn by surface.js. The page gives an element #room-data with JSON
// {low, step, positions, colours, sigma_step, sigmas, triangles, path, voxel, unit, scale_sigma}:
// x along the walls, y across, z up from the floor; arrays are base64, little-endian: positions
// uint16 in steps from low, colours three bytes, sigmas a byte in sigma_steps, triangles uint32,
// anticlockwise as seen from the free side. Surfaces that are seen from behind are not drawn: one
// looks into the room from outside.
(function () {
  "use strict";
  const data = JSON.parse(document.getElementById("room-data").textContent);
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const numbers = function (text, size, get) {
    const view = new DataView(bytes(text).buffer), count = view.byteLength / size;
    return Array.from({ length: count }, (_, i) => view[get](size * i, true));
  };
  const place = Float32Array.from(numbers(data.positions, 2, "getUint16"),
    (value, i) => data.low[i % 3] + data.step * value);
  const corners = Uint32Array.from(numbers(data.triangles, 4, "getUint32"));
  const photo = bytes(data.colours), sigmas = bytes(data.sigmas);
  const count = place.length / 3;

  // Normals of the vertices: the sum of those of their triangles, towards the free side.
  const normals = new Float32Array(3 * count);
  for (let t = 0; t < corners.length; t += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => 3 * corners[t + k]);
    const u = [0, 1, 2].map((k) => place[b + k] - place[a + k]);
    const v = [0, 1, 2].map((k) => place[c + k] - place[a + k]);
    const n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    for (const at of [a, b, c]) for (let k = 0; k < 3; ++k) normals[at + k] += n[k];
  }
  for (let i = 0; i < count; ++i) {
    const length = Math.hypot(normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]) || 1;
    for (let k = 0; k < 3; ++k) normals[3 * i + k] /= length;
  }

  const canvas = document.getElementById("room"), context = canvas.getContext("2d");
  const sheet = document.createElement("canvas"), sheetContext = sheet.getContext("2d");
  const readout = document.getElementById("room-readout");

  // The middle and half the extent of the central 98 % on each axis.
  const share = function (axis, part) {
    const values = Float32Array.from({ length: count }, (_, i) => place[3 * i + axis]).sort();
    return values[Math.min(count - 1, Math.floor(part * count))];
  };
  const low = [0, 1, 2].map((axis) => share(axis, 0.01));
  const high = [0, 1, 2].map((axis) => share(axis, 0.99));
  const middle = low.map((value, axis) => (value + high[axis]) / 2);
  const radius = Math.hypot(...low.map((value, axis) => high[axis] - value)) / 2 || 1;

  // The eye: yaw about the vertical, pitch below the horizon, radians. Around the room it looks at
  // `target` from `distance`; a walker stands at `eye`.
  const start = { yaw: 0.9, pitch: 0.75, distance: 2.5 * radius, target: middle.slice() };
  const view = Object.assign({ walks: false, eye: middle.slice(), shape: false, path: true }, start);
  let marks = [], pending = 0, buffers = null;

  function camera() {
    const cy = Math.cos(view.yaw), sy = Math.sin(view.yaw);
    const cp = Math.cos(view.pitch), sp = Math.sin(view.pitch);
    const forward = [cy * cp, sy * cp, -sp], right = [sy, -cy, 0];
    const down = [-cy * sp, -sy * sp, -cp];
    const eye = view.walks ? view.eye
      : view.target.map((value, k) => value - view.distance * forward[k]);
    return { eye, right, down, forward };
  }

  function project(frame, width, height) {
    const focal = (view.walks ? 0.62 : 1.0) * Math.min(width, 1.5 * height);
    const { eye, right, down, forward } = frame, near = 0.01 * radius;
    return function (x, y, z, out) {
      x -= eye[0];
      y -= eye[1];
      z -= eye[2];
      const depth = forward[0] * x + forward[1] * y + forward[2] * z;
      if (depth < near) return false;
      out[0] = width / 2 + focal * (right[0] * x + right[1] * y + right[2] * z) / depth;
      out[1] = height / 2 + focal * (down[0] * x + down[1] * y + down[2] * z) / depth;
      out[2] = 1 / depth;
      return true;
    };
  }

  // Draws the triangles into a target of surface.js.
  function rasterize(target) {
    const frame = camera();
    const shade = view.shape ? new Uint8Array(count) : null;
    for (let i = 0; shade && i < count; ++i) {
      const n = normals.subarray(3 * i, 3 * i + 3);
      const facing = -(n[0] * frame.forward[0] + n[1] * frame.forward[1] + n[2] * frame.forward[2]);
      shade[i] = Math.max(40, Math.min(245, 90 + 150 * facing + 25 * n[2]));
    }
    window.twoviewDrawSurface(target, { place, corners, colours: photo, shade },
      project(frame, target.width, target.height), 0xff1d1814);
  }

  function bufferOf(width, height) {
    if (buffers && buffers.width === width && buffers.height === height) return buffers;
    sheet.width = width;
    sheet.height = height;
    const image = sheetContext.createImageData(width, height);
    buffers = { width, height, image, pixels: new Uint32Array(image.data.buffer),
                near: new Float32Array(width * height), hit: new Int32Array(width * height) };
    return buffers;
  }

  // Coarse while the view moves, where a whole drawing takes too long.
  let cost = 0;
  function draw(coarse) {
    const width = canvas.width = canvas.clientWidth, height = canvas.height = canvas.clientHeight;
    if (!width || !height) return;
    const factor = coarse && cost > 60 ? 2 : 1;
    const target = bufferOf(Math.ceil(width / factor), Math.ceil(height / factor));
    const began = performance.now();
    rasterize(target);
    if (factor === 1) cost = performance.now() - began;
    sheetContext.putImageData(target.image, 0, 0);
    context.imageSmoothingEnabled = false;
    context.drawImage(sheet, 0, 0, target.width * factor, target.height * factor);
    overlay(width, height);
  }

  function overlay(width, height) {
    const to = project(camera(), width, height), p = [0, 0, 0];
    const stroke = function (points, colour, thickness) {
      context.strokeStyle = colour;
      context.lineWidth = thickness;
      context.beginPath();
      let open = false;
      for (const point of points) {
        if (!to(point[0], point[1], point[2], p)) { open = false; continue; }
        if (open) context.lineTo(p[0], p[1]); else context.moveTo(p[0], p[1]);
        open = true;
      }
      context.stroke();
    };
    if (view.path && !view.walks) {
      const points = [];
      for (let i = 0; i + 2 < data.path.length; i += 3) points.push(data.path.slice(i, i + 3));
      stroke(points, "#ffd75ecc", 1.5);
    }
    if (marks.length === 2) stroke(marks.map((mark) => mark.place), "#ff5d5d", 2.5);
    for (const mark of marks) {
      if (!to(...mark.place, p)) continue;
      context.fillStyle = "#ff5d5d";
      context.beginPath();
      context.arc(p[0], p[1], 5, 0, 6.2832);
      context.fill();
    }
  }

  let settle = 0;
  function request() {
    if (pending) return;
    pending = window.requestAnimationFrame(function () {
      pending = 0;
      draw(true);
      window.clearTimeout(settle);
      settle = window.setTimeout(() => draw(false), 150);
    });
  }

  // What a pixel of the canvas shows: {place, ray, normal, sigma}, or null. ray: from the eye to it.
  function pick(x, y) {
    const target = bufferOf(canvas.clientWidth, canvas.clientHeight);
    rasterize(target);
    const column = Math.round(x), row = Math.round(y);
    if (column < 0 || row < 0 || column >= target.width || row >= target.height) return null;
    const at = row * target.width + column, t = target.hit[at];
    if (t < 0) return null;
    const frame = camera(), depth = 1 / target.near[at];
    const focal = (view.walks ? 0.62 : 1.0) * Math.min(target.width, 1.5 * target.height);
    const u = (column - target.width / 2) / focal, v = (row - target.height / 2) / focal;
    const ray = [0, 1, 2].map((k) => frame.forward[k] + u * frame.right[k] + v * frame.down[k]);
    const found = ray.map((value, k) => frame.eye[k] + depth * value);
    const vertex = corners[t];
    return { place: found, ray, normal: Array.from(normals.subarray(3 * vertex, 3 * vertex + 3)),
             sigma: data.sigma_step * sigmas[vertex] };
  }

  // The distance of two places with its standard deviation: of the surface along its normal, which
  // moves what a ray meets along the ray, of half a voxel across it (a surface of voxels has no
  // sharper edges), and of the scale.
  function measure(a, b) {
    const dot = (p, q) => p.reduce((sum, value, k) => sum + value * q[k], 0);
    const way = a.place.map((value, k) => b.place[k] - value), distance = Math.hypot(...way);
    let variance = Math.pow(distance * data.scale_sigma, 2);
    for (const end of [a, b]) {
      const cosine = distance ? Math.abs(dot(way, end.normal)) / distance : 1;
      const along = distance ? Math.abs(dot(way, end.ray)) / distance : Math.hypot(...end.ray);
      const facing = Math.abs(dot(end.ray, end.normal));
      variance += Math.pow(end.sigma * along / Math.max(facing, 0.2 * Math.hypot(...end.ray)), 2) +
        Math.pow(data.voxel / 2, 2) * Math.max(0, 1 - cosine * cosine);
    }
    return { distance, sigma: Math.sqrt(variance), rise: Math.abs(way[2]) };
  }

  const hint = readout.textContent;
  function show() {
    if (marks.length === 0) readout.textContent = hint;
    if (marks.length === 1) readout.textContent = "Click on the second place.";
    if (marks.length < 2) return;
    const found = measure(marks[0], marks[1]), unit = data.unit ? " " + data.unit : "";
    const digits = Math.max(0, Math.min(6, 1 - Math.floor(Math.log10(found.sigma || 1e-3))));
    readout.textContent = found.distance.toFixed(digits) + unit + " \u00b1 " +
      found.sigma.toFixed(digits) + unit + " (one standard deviation), of it " +
      found.rise.toFixed(digits) + unit + " upright" +
      (data.unit ? "." : ": in the unit of the path, which is not the metre.");
  }

  function click(x, y) {
    const found = pick(x, y);
    if (marks.length === 2) marks = [];
    if (found) marks.push(found);
    show();
    request();
  }

  function step(ahead, aside, up) {
    if (view.walks) {
      const cy = Math.cos(view.yaw), sy = Math.sin(view.yaw);
      view.eye[0] += ahead * cy + aside * sy;
      view.eye[1] += ahead * sy - aside * cy;
      view.eye[2] += up;
    } else {
      view.distance = Math.max(0.05 * radius, view.distance - ahead);
    }
    request();
  }

  window.twoviewGestures(canvas, {
    hold: () => canvas.focus(),
    turn: function (dx, dy) {
      const side = view.walks ? -1 : 1;
      view.yaw -= 0.006 * side * dx;
      view.pitch = Math.max(-1.57, Math.min(1.57, view.pitch + 0.006 * side * dy));
      request();
    },
    shift: function (dx, dy) {
      const frame = camera(), size = view.walks ? 0.15 * radius : view.distance;
      const by = size / Math.min(canvas.clientWidth, 1.5 * canvas.clientHeight);
      const moved = view.walks ? view.eye : view.target;
      for (let k = 0; k < 3; ++k) moved[k] -= by * (dx * frame.right[k] + dy * frame.down[k]);
      request();
    },
    zoom: function (factor) {
      if (view.walks) step(0.25 * radius * Math.log(factor), 0, 0);
      else { view.distance = Math.max(0.05 * radius, view.distance / factor); request(); }
    },
    click: click,
  });
  const keys = { w: [1, 0, 0], ArrowUp: [1, 0, 0], s: [-1, 0, 0], ArrowDown: [-1, 0, 0],
                 a: [0, -1, 0], ArrowLeft: [0, -1, 0], d: [0, 1, 0], ArrowRight: [0, 1, 0],
                 e: [0, 0, 1], q: [0, 0, -1] };
  canvas.addEventListener("keydown", function (event) {
    const way = keys[event.key];
    if (!way || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault();
    step(...way.map((value) => 0.035 * radius * value));
  });

  const button = (name, action) => document.getElementById("room-" + name).addEventListener(
    "click", function () { action(); request(); });
  const around = (yaw, pitch) => Object.assign(view, start,
    { walks: false, yaw, pitch, target: middle.slice() });
  button("around", () => around(start.yaw, start.pitch));
  button("top", () => around(Math.PI / 2, 1.57));
  button("walk", function () {
    const at = 3 * Math.floor(data.path.length / 6);
    Object.assign(view, { walks: true, pitch: 0.1, eye: data.path.slice(at, at + 3) });
    if (view.eye.length < 3) view.eye = middle.slice();
  });
  button("shape", () => { view.shape = !view.shape; });
  window.addEventListener("resize", request);
  window.roomViewer = { view, pick, measure, click, draw: () => draw(false) };
  draw(false);
})();
