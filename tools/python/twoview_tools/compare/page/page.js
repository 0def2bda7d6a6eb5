"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const IN_FIRST_VIEW = 20;
const ROW = { system: 0, status: 1, rotation: 2, translation: 3, pose: 4, matches: 5, inliers: 6, precision: 7, ms: 8, message: 9 };
const LINE_COLOURS = ["#ffb000", "#38bdf8", "#f472b6", "#a3e635", "#c084fc", "#fb923c", "#2dd4bf", "#facc15"];
const ours = data.systems.findIndex(s => s.id === "twoview");

function element(tag, text, ...children) {
  const made = document.createElement(tag);
  if (text) made.textContent = text;
  made.append(...children);
  return made;
}
function shown(value, unit = "") {
  return value === null || value === undefined ? "–" : value + unit;
}

// ---- tables and plots -------------------------------------------------------------------------

// Marks the best system in each column of each table: the largest AUC or precision, the least
// error. Systems that get more input than the others (data-given) are not compared.
function markBest() {
  const LESS = new Set([4, 5, 6]), MORE = new Set([1, 2, 3, 10]);
  for (const table of document.querySelectorAll(".systems")) {
    if (table.rows[0].cells.length !== 12) continue;
    for (const column of [...LESS, ...MORE]) {
      const rows = [...table.tBodies[0].rows].filter(r => !("given" in r.dataset));
      const cells = rows.map(r => r.cells[column]).filter(Boolean);
      const values = cells.map(c => parseFloat(c.textContent)), known = values.filter(Number.isFinite);
      const best = (LESS.has(column) ? Math.min : Math.max)(...known);
      if (known.some(v => v !== best))
        cells.forEach((c, i) => c.classList.toggle("best", values[i] === best));
    }
  }
}

function theme() {
  const style = getComputedStyle(document.documentElement);
  const ink = style.getPropertyValue("--ink").trim(), line = style.getPropertyValue("--line").trim();
  const axis = { gridcolor: line, linecolor: line, zerolinecolor: line, tickcolor: line };
  return { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: ink, size: 12 }, axis };
}

function drawPlot(box) {
  const figure = JSON.parse(box.querySelector("script").textContent);
  const { axis, ...rest } = theme();
  const layout = { ...figure.layout, ...rest };
  layout.xaxis = { ...axis, ...layout.xaxis };
  layout.yaxis = { ...axis, ...layout.yaxis };
  // Puts the legend below the plot and adds its height to the margin; plotly alone would draw it
  // over the axis's title.
  const columns = Math.max(1, Math.floor((box.clientWidth - 30) / 260));
  const legend = 18 * Math.ceil(figure.data.filter(d => d.showlegend !== false).length / columns) + 8;
  layout.legend = { ...layout.legend, orientation: "h", entrywidth: 1 / columns - 0.01, entrywidthmode: "fraction", x: 0, yref: "container", y: 0.01, yanchor: "bottom" };
  layout.margin = { ...layout.margin, b: layout.margin.b + legend };
  box.style.height = 360 + legend + "px";
  Plotly.newPlot(box, figure.data, layout, { displayModeBar: false, responsive: true });
  box.on("plotly_click", event => {
    const index = event.points[0].customdata;
    if (Number.isInteger(index)) openPair(index);
  });
}

const seen = new IntersectionObserver(entries => {
  for (const entry of entries)
    if (entry.isIntersecting) { seen.unobserve(entry.target); drawPlot(entry.target); }
}, { rootMargin: "600px" });

function drawnPlots() {
  return [...document.querySelectorAll(".plot.js-plotly-plot")];
}

// ---- geometry, as docs/algorithms/camera.md has it: pixels to undistorted points and back --------

function distort([fx, fy, cx, cy, k1, k2, p1, p2, k3], x, y) {
  const s = x * x + y * y, radial = 1 + s * (k1 + s * (k2 + s * k3));
  return [fx * (x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x)) + cx,
          fy * (y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y) + cy];
}
function undistort(camera, u, v) {
  const [fx, fy, cx, cy] = camera;
  const goal = [(u - cx) / fx, (v - cy) / fy];
  let [x, y] = goal;
  for (let i = 0; i < 30; ++i) {
    const [du, dv] = distort(camera, x, y);
    x += goal[0] - (du - cx) / fx;
    y += goal[1] - (dv - cy) / fy;
  }
  return [x, y, 1];
}
function essential([r0, r1, r2, r3, r4, r5, r6, r7, r8, t0, t1, t2]) {
  const R = [[r0, r1, r2], [r3, r4, r5], [r6, r7, r8]];
  const cross = [[0, -t2, t1], [t2, 0, -t0], [-t1, t0, 0]];
  return cross.map(row => [0, 1, 2].map(c => row[0] * R[0][c] + row[1] * R[1][c] + row[2] * R[2][c]));
}
// The epipolar line of `point`, a ray of the other view, as pixels of this view.
function epipolarCurve(E, isSecond, point, camera, size) {
  const [a, b, c] = isSecond ? E.map(row => row[0] * point[0] + row[1] * point[1] + row[2])
    : [0, 1, 2].map(i => E[0][i] * point[0] + E[1][i] * point[1] + E[2][i]);
  const norm = a * a + b * b;
  if (!(norm > 1e-24)) return [];
  const foot = [-a * c / norm, -b * c / norm], along = [-b / Math.sqrt(norm), a / Math.sqrt(norm)];
  const reach = 1.15 * Math.max(...[[0, 0], [size[0], 0], [0, size[1]], size].map(corner => {
    const [x, y] = undistort(camera, ...corner);
    return Math.hypot(x, y);
  }));
  const curve = [];
  for (let i = -40; i <= 40; ++i) {
    const x = foot[0] + along[0] * reach * i / 40, y = foot[1] + along[1] * reach * i / 40;
    if (Math.hypot(x, y) <= reach) curve.push(distort(camera, x, y));
  }
  return curve;
}

// ---- pictures ----------------------------------------------------------------------------------

function loadImage(index) {
  const image = data.images[index];
  image.loading ??= new Promise(resolve => {
    const made = new Image();
    made.onload = () => resolve(made);
    made.src = image.src;
  });
  return image.loading;
}

async function sideBySide(canvas, pair) { // {context, place: canvas position of a pixel, clip to a view, sizes}
  const images = await Promise.all(pair.images.map(loadImage));
  const sizes = pair.images.map(i => [data.images[i].width, data.images[i].height]);
  const height = Math.max(sizes[0][1], sizes[1][1]), gap = 8;
  const scale = 840 / (sizes[0][0] + sizes[1][0] + gap);
  canvas.width = 840;
  canvas.height = Math.round(height * scale);
  const context = canvas.getContext("2d"), left = [0, sizes[0][0] + gap];
  images.forEach((image, i) => context.drawImage(image, left[i] * scale, 0, sizes[i][0] * scale, sizes[i][1] * scale));
  const place = (view, x, y) => [(left[view] + x + 0.5) * scale, (y + 0.5) * scale];
  const clip = view => {
    context.beginPath();
    context.rect(left[view] * scale, 0, sizes[view][0] * scale, sizes[view][1] * scale);
    context.clip();
  };
  return { context, place, clip, sizes };
}

async function drawMatches(canvas, pair, picture) {
  const { context, place } = await sideBySide(canvas, pair);
  for (const [list, colour] of [[picture.out, "rgba(255,70,80,.75)"], [picture.in, "rgba(60,230,120,.8)"]]) {
    context.strokeStyle = colour;
    context.lineWidth = 1.1;
    for (let i = 0; i < list.length; i += 4) {
      context.beginPath();
      context.moveTo(...place(0, list[i], list[i + 1]));
      context.lineTo(...place(1, list[i + 2], list[i + 3]));
      context.stroke();
    }
  }
}

// The camera with its principal point moved by the shift that was estimated with the pose.
function moved([fx, fy, cx, cy, ...lens], [dx, dy]) {
  return [fx, fy, cx + dx, cy + dy, ...lens];
}

async function drawLines(canvas, pair, picture, points) {
  const { context, place, clip, sizes } = await sideBySide(canvas, pair);
  const poses = [[picture.pose, picture.shift, [], 2], [pair.reference, [0, 0], [6, 5], 1.3]].filter(([p]) => p);
  points.forEach((pixels, number) => {
    const colour = LINE_COLOURS[number % LINE_COLOURS.length];
    for (const view of [0, 1]) {
      const here = pixels.slice(2 * view, 2 * view + 2), other = pixels.slice(2 - 2 * view, 4 - 2 * view);
      context.save();
      clip(view);
      for (const [p, shift, dash, width] of poses) {
        const ray = undistort(moved(pair.cameras[1 - view], shift), ...other);
        const curve = epipolarCurve(essential(p), view === 1, ray, moved(pair.cameras[view], shift), sizes[view]);
        context.setLineDash(dash);
        context.lineWidth = width;
        context.strokeStyle = colour;
        context.beginPath();
        curve.forEach((at, i) => context[i ? "lineTo" : "moveTo"](...place(view, ...at)));
        context.stroke();
      }
      context.setLineDash([]);
      context.lineWidth = 2;
      context.strokeStyle = "#fff";
      context.fillStyle = colour;
      context.beginPath();
      context.arc(...place(view, ...here), 4.5, 0, 7);
      context.stroke();
      context.fill();
      context.restore();
    }
  });
}

// At most eight matches whose epipolar lines are drawn: inliers of twoview, else of another system.
function commonPoints(pair) {
  const pictures = Object.entries(pair.pictures).sort(([a], [b]) => (+b === ours) - (+a === ours));
  for (const [, picture] of pictures) {
    const count = picture.in.length / 4;
    if (count < 2) continue;
    const chosen = [...new Set(Array.from({ length: 8 }, (_, i) => Math.floor((i + 0.5) * count / 8)))];
    return chosen.map(i => picture.in.slice(4 * i, 4 * i + 4));
  }
  return [];
}

// ---- the list of pairs -------------------------------------------------------------------------

function rowOf(pair, system) {
  return pair.rows.find(row => row[ROW.system] === system);
}
function errorOf(row) {
  return !row ? NaN : row[ROW.pose] === null ? Infinity : row[ROW.pose];
}
for (const pair of data.pairs) {
  const first = rowOf(pair, ours) || pair.rows[0];
  const others = pair.rows.filter(r => r !== first && data.systems[r[ROW.system]].kind === "pipeline");
  pair.ours = errorOf(first);
  pair.best = Math.min(...others.map(errorOf));
  // A pair without a pose (error Infinity) counts as 180 degrees, so that differences stay finite.
  pair.behind = Math.min(pair.ours, 180) - Math.min(pair.best, 180);
}
const ORDERS = {
  worst: (a, b) => b.ours - a.ours || 0,
  behind: (a, b) => b.behind - a.behind,
  ahead: (a, b) => a.behind - b.behind,
  listed: null,
};

function degrees(error) {
  return error === Infinity ? "no pose" : Number.isNaN(error) ? "–" : error.toPrecision(3) + "°";
}

function pairTable(pair) {
  const head = element("tr");
  for (const title of ["system", "pose error", "rotation", "translation", "matches", "inliers", "precision", "ms"])
    head.append(element("th", title));
  const body = element("tbody");
  const rows = [...pair.rows].sort((a, b) => (errorOf(a) - errorOf(b)) || 0);
  for (const row of rows) {
    const system = data.systems[row[ROW.system]];
    const line = element("tr", "", element("th", system.name + (system.kind === "solver" ? " (solver)" : "")));
    if (system.id.startsWith("twoview")) line.className = "ours";
    if (row[ROW.status] !== "ok") {
      const told = element("td", row[ROW.status].replace("_", " ") + (row[ROW.message] ? ": " + row[ROW.message] : ""));
      told.colSpan = 7;
      told.className = "told";
      line.append(told);
    } else {
      for (const key of ["pose", "rotation", "translation"]) line.append(element("td", shown(row[ROW[key]], "°")));
      for (const key of ["matches", "inliers"]) line.append(element("td", shown(row[ROW[key]])));
      line.append(element("td", row[ROW.precision] === null ? "–" : (100 * row[ROW.precision]).toFixed(1)),
                  element("td", shown(row[ROW.ms])));
    }
    body.append(line);
  }
  const table = element("table", "", element("thead", "", head), body);
  table.className = "systems";
  return element("div", "", table);
}

async function fillPair(box, pair) {
  const body = element("div");
  body.className = "body";
  box.append(body);
  const pictures = element("div");
  pictures.className = "pictures";
  body.append(pictures);
  const table = pairTable(pair);
  table.className = "wide";
  body.append(table);
  const points = commonPoints(pair);
  for (const row of pair.rows) {
    const system = data.systems[row[ROW.system]], picture = pair.pictures[row[ROW.system]];
    if (system.kind !== "pipeline") continue;
    const caption = element("figcaption", system.name + " ");
    const figure = element("figure", "", caption);
    pictures.append(figure);
    if (!picture) {
      const told = element("em", row[ROW.status].replace("_", " ") + (row[ROW.message] ? ": " + row[ROW.message] : ""));
      told.className = "none";
      caption.append(told);
      continue;
    }
    caption.append(element("em", (picture.pose ? pair.reference ? degrees(errorOf(row)) : "pose" : "no pose") +
      `, ${picture.within} of ${row[ROW.matches]} matches within ${data.maxErrorPx} px`));
    const matches = element("canvas"), lines = element("canvas");
    figure.append(matches, lines);
    await drawMatches(matches, pair, picture);
    await drawLines(lines, pair, picture, points);
  }
}

function pairBox(pair) {
  const box = element("details");
  const summary = element("summary", "", element("span", `${pair.set}: ${pair.names[0]} → ${pair.names[1]}`));
  if (pair.reference) {
    summary.append(element("em", "twoview " + degrees(pair.ours)), element("em", "best other pipeline " + degrees(pair.best)));
  } else {
    summary.append(element("em", "no reference"));
  }
  box.append(summary);
  box.addEventListener("toggle", () => { if (box.open && box.children.length === 1) fillPair(box, pair); });
  pair.box = box;
  return box;
}

let listed = [], isShown = 0;
const list = document.getElementById("pairs"), more = document.getElementById("more");
const setChoice = document.getElementById("set"), order = document.getElementById("order"), filter = document.getElementById("filter");

function showMore(count) {
  list.append(...listed.slice(isShown, isShown + count).map(pairBox));
  isShown = Math.min(listed.length, isShown + count);
  more.hidden = isShown >= listed.length;
  document.getElementById("count").textContent = `${isShown} of ${listed.length} pairs`;
}
function showPairs() {
  const set = setChoice ? setChoice.value : "all", words = filter.value.toLowerCase();
  listed = data.pairs.filter(p => (set === "all" || p.set === set) && (p.set + " " + p.names.join(" ")).toLowerCase().includes(words));
  if (ORDERS[order.value]) { // pairs that have a reference come first, sorted
    const known = listed.filter(p => p.reference).sort(ORDERS[order.value]);
    listed = known.concat(listed.filter(p => !p.reference));
  }
  list.replaceChildren();
  isShown = 0;
  showMore(IN_FIRST_VIEW);
}
function openPair(index) {
  const pair = data.pairs[index];
  if (setChoice) setChoice.value = "all";
  filter.value = "";
  chooseSet();
  while (isShown <= listed.indexOf(pair)) showMore(100);
  pair.box.open = true;
  pair.box.scrollIntoView();
}
function chooseSet() {
  const set = setChoice ? setChoice.value : "all";
  for (const part of document.querySelectorAll("[data-set]")) part.hidden = part.dataset.set !== set;
  showPairs();
}

markBest();
document.querySelectorAll(".plot").forEach(box => seen.observe(box));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  const { axis, ...rest } = theme();
  const change = { ...rest };
  for (const [key, value] of Object.entries(axis)) change["xaxis." + key] = change["yaxis." + key] = value;
  drawnPlots().forEach(box => Plotly.relayout(box, change));
});
setChoice?.addEventListener("change", chooseSet);
order.addEventListener("change", showPairs);
filter.addEventListener("input", showPairs);
more.addEventListener("click", () => showMore(100));
document.querySelector("noscript")?.remove();
showPairs();
// The address index.html#pair-1 opens the first pair of pairs.csv.
const linked = /^#pair-(\d+)$/.exec(location.hash);
if (linked && data.pairs[linked[1] - 1]) openPair(linked[1] - 1);
