// An interactive view of a point cloud: dragging rotates it (gestures.js). Plain canvas: no library,
// no network, no GPU needed. The page gives an element #cloud-data with JSON {points, colours, cameras}; points
// and colours are base64. It may give paths, each {points, colour} with points x y z one after the
// other; a colour of a camera; and the names of the axes. After a change of these it sends the event
// "cloud-changed" to the window.
(function () {
  "use strict";
  const data = JSON.parse(document.getElementById("cloud-data").textContent);
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const view = new DataView(bytes(data.points).buffer);
  const colours = bytes(data.colours);
  const count = view.byteLength / 12;
  const points = new Float32Array(3 * count);
  for (let i = 0; i < points.length; ++i) points[i] = view.getFloat32(4 * i, true);

  const canvas = document.getElementById("cloud");
  const context = canvas.getContext("2d");

  // The centre and half the extent of the central 94 % of the points on each axis, so that a few
  // distant points do not determine the view.
  const middle = [0, 1, 2].map((axis) => (share(axis, 0.03) + share(axis, 0.97)) / 2);
  let radius = 0;
  for (let axis = 0; axis < 3; ++axis)
    radius = Math.max(radius, (share(axis, 0.97) - share(axis, 0.03)) / 2);
  radius = radius || 1;
  function share(axis, part) {
    const values = [];
    for (let i = 0; i < count; ++i) values.push(points[3 * i + axis]);
    values.sort((a, b) => a - b);
    return values[Math.min(count - 1, Math.floor(part * count))];
  }

  // Yaw rotates the view about the image's vertical axis, pitch about its horizontal axis, in
  // radians; with both 0 it looks in camera 0's direction.
  const start = { yaw: -0.45, pitch: 0.22, zoom: 1, x: 0, y: 0 };
  let pose = Object.assign({}, start);
  let moved = false;
  let turning = !window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  let frame = 0;

  function resize() {
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    if (!moved) fit();
    draw();
  }

  function projector() {
    const cy = Math.cos(pose.yaw), sy = Math.sin(pose.yaw);
    const cp = Math.cos(pose.pitch), sp = Math.sin(pose.pitch);
    const distance = 4.2 * radius / pose.zoom;
    const focal = 1.05 * Math.min(canvas.width, 1.6 * canvas.height);
    return function (px, py, pz) {
      const x = px - middle[0], y = py - middle[1], z = pz - middle[2];
      const u = cy * x + sy * z, w = -sy * x + cy * z;
      const v = cp * y - sp * w, depth = sp * y + cp * w + distance;
      if (depth < 0.02 * distance) return null;
      return [
        canvas.width / 2 + focal * (u / depth + pose.x),
        canvas.height / 2 + focal * (v / depth + pose.y),
        depth,
      ];
    };
  }

  // Chooses the first view's zoom so that both cameras are in it, throughout the swing.
  function fit() {
    const seen = (point) => {
      const p = projector()(point[0], point[1], point[2]);
      return p && p[0] > 0.03 * canvas.width && p[0] < 0.97 * canvas.width &&
        p[1] > 0.03 * canvas.height && p[1] < 0.97 * canvas.height;
    };
    const all = data.cameras.flatMap((camera) => [camera.centre, ...camera.corners]);
    for (start.zoom = 1; start.zoom > 0.15; start.zoom *= 0.95) {
      const fits = [-0.45, 0, 0.45].every((yaw) => {
        pose = Object.assign({}, start, { yaw: yaw });
        return all.every(seen);
      });
      if (fits) break;
    }
    pose = Object.assign({}, start);
  }

  function line(project, a, b, colour, width) {
    const p = project(a[0], a[1], a[2]), q = project(b[0], b[1], b[2]);
    if (!p || !q) return;
    context.strokeStyle = colour;
    context.lineWidth = width * (window.devicePixelRatio || 1);
    context.beginPath();
    context.moveTo(p[0], p[1]);
    context.lineTo(q[0], q[1]);
    context.stroke();
  }

  function draw() {
    context.fillStyle = "#14181d";
    context.fillRect(0, 0, canvas.width, canvas.height);
    const project = projector();
    const drawn = [];
    for (let i = 0; i < count; ++i) {
      const p = project(points[3 * i], points[3 * i + 1], points[3 * i + 2]);
      if (p) drawn.push([p, i]);
    }
    drawn.sort((a, b) => b[0][2] - a[0][2]);
    const dot = count > 8000 ? 1.3 : count > 2500 ? 1.9 : 2.9;
    const size = dot * (window.devicePixelRatio || 1) * 3.2 * radius;
    // Dark points would not be seen on black: black becomes a grey of 88, white stays white.
    const lift = (c) => Math.round(88 + 167 * Math.pow(c / 255, 0.8));
    for (const [p, i] of drawn) {
      const r = Math.min(12, Math.max(0.8, size / p[2]));
      const rgb = [0, 1, 2].map((k) => lift(colours[3 * i + k]));
      context.fillStyle = "rgb(" + rgb.join(",") + ")";
      if (count > 8000) {  // squares are drawn several times as fast
        context.fillRect(p[0] - r, p[1] - r, 2 * r, 2 * r);
        continue;
      }
      context.beginPath();
      context.arc(p[0], p[1], r, 0, 6.2832);
      context.fill();
    }
    (data.paths || []).forEach(function (path) {
      for (let i = 3; i + 2 < path.points.length; i += 3)
        line(project, path.points.slice(i - 3, i), path.points.slice(i, i + 3), path.colour, 1.8);
    });
    data.cameras.forEach(function (camera, index) {
      const colour = camera.colour || (index ? "#ffb260" : "#ffffff");
      for (let i = 0; i < 4; ++i) {
        line(project, camera.centre, camera.corners[i], colour, 1);
        line(project, camera.corners[i], camera.corners[(i + 1) % 4], colour, 1.6);
      }
    });
    axes();
  }

  // Draws small axes in the lower left corner, along x, y and z of camera 0's frame.
  function axes() {
    const ratio = window.devicePixelRatio || 1, length = 34 * ratio;
    const at = [56 * ratio, canvas.height - 56 * ratio];
    const cy = Math.cos(pose.yaw), sy = Math.sin(pose.yaw);
    const cp = Math.cos(pose.pitch), sp = Math.sin(pose.pitch);
    const turn = ([x, y, z]) => [cy * x + sy * z, cp * y - sp * (-sy * x + cy * z)];
    context.font = 12 * ratio + "px sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    const names = data.axes || ["x", "y", "z"];
    [[[1, 0, 0], "#ff7b72"], [[0, 1, 0], "#7ee787"], [[0, 0, 1], "#79c0ff"]].forEach(
      function ([axis, colour], index) {
        const name = names[index];
        const d = turn(axis);
        context.strokeStyle = context.fillStyle = colour;
        context.lineWidth = 2 * ratio;
        context.beginPath();
        context.moveTo(at[0], at[1]);
        context.lineTo(at[0] + length * d[0], at[1] + length * d[1]);
        context.stroke();
        context.fillText(name, at[0] + 1.32 * length * d[0], at[1] + 1.32 * length * d[1]);
      });
  }

  function request() {
    if (!frame) frame = window.requestAnimationFrame(function () { frame = 0; draw(); });
  }

  window.twoviewGestures(canvas, {
    hold: function () {
      turning = false;
      moved = true;
    },
    turn: function (dx, dy) {
      pose.yaw += 0.007 * dx;
      pose.pitch = Math.max(-1.57, Math.min(1.57, pose.pitch - 0.007 * dy));
      request();
    },
    shift: function (dx, dy) {
      const focal = 1.05 * Math.min(canvas.clientWidth, 1.6 * canvas.clientHeight);
      pose.x += dx / focal;
      pose.y += dy / focal;
      request();
    },
    zoom: zoom,
  });
  function zoom(factor) {
    pose.zoom = Math.max(0.15, Math.min(40, pose.zoom * factor));
    request();
  }
  function look(yaw, pitch) {
    turning = false;
    moved = true;
    pose = Object.assign({}, start, { yaw: yaw, pitch: pitch });
    request();
  }
  canvas.addEventListener("dblclick", () => look(start.yaw, start.pitch));
  document.getElementById("view-front").addEventListener("click", () => look(0, 0));
  document.getElementById("view-side").addEventListener("click", () => look(Math.PI / 2, 0));
  document.getElementById("view-top").addEventListener("click", () => look(0, 1.57));

  // The cloud swings slowly to the left and right until the user moves it.
  let began = 0;
  function swing(now) {
    if (!turning) return;
    began = began || now;
    pose.yaw = start.yaw * Math.cos((now - began) / 2600);
    draw();
    window.requestAnimationFrame(swing);
  }
  window.cloudData = data;
  window.addEventListener("cloud-changed", request);
  window.addEventListener("resize", resize);
  resize();
  window.requestAnimationFrame(swing);
})();
