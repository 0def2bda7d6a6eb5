// The charts over time and the keyframes of a flight's report. The page gives an element
// #flight-data with JSON {statuses, frames, keyframes, unit}.
(function () {
  "use strict";
  const data = JSON.parse(document.getElementById("flight-data").textContent);
  const frames = data.frames, keyframes = data.keyframes, count = frames.status.length;
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const colourOf = (status) => css("--" + data.statuses[status]);
  let pointed = -1, shown = -1;

  const legend = document.getElementById("legend");
  data.statuses.forEach(function (name, status) {
    const share = frames.status.filter((value) => value === status).length;
    const item = document.createElement("span"), box = document.createElement("i");
    box.style.background = colourOf(status);
    item.append(box, name + " " + share);
    legend.append(item);
  });

  // A chart draws one column a frame; `values` may hold nulls. The vertical axis starts at 0.
  const charts = [];
  function add(title, height, values, kind) {
    const box = document.createElement("div"), text = document.createElement("p");
    const canvas = document.createElement("canvas");
    box.className = "chart";
    text.textContent = title;
    canvas.style.height = height + "px";
    box.append(text, canvas);
    document.getElementById("charts").append(box);
    const top = kind === "strip" ? 1 : Math.max(1e-12, ...values.filter((v) => v !== null));
    charts.push({ canvas: canvas, values: values, kind: kind, top: top });
    canvas.addEventListener("pointermove", (event) => point(event, canvas));
    canvas.addEventListener("pointerleave", function () { pointed = -1; drawAll(); });
    canvas.addEventListener("click", function (event) {
      point(event, canvas);
      select(nearestKeyframe(pointed));
    });
  }
  add("Status, and the keyframes as ticks", 34, frames.status, "strip");
  add("Points of the map that a frame sees (inliers)", 84, frames.inliers, "line");
  add("CPU time a frame, ms; keyframes darker", 84, frames.ms, "bars");
  if (frames.error)
    add("Distance of the position from the truth, " + data.truth_unit, 84, frames.error, "line");

  function point(event, canvas) {
    const box = canvas.getBoundingClientRect();
    pointed = Math.max(0, Math.min(count - 1,
      Math.floor((event.clientX - box.left) / box.width * count)));
    drawAll();
  }

  function draw(chart) {
    const ratio = window.devicePixelRatio || 1, canvas = chart.canvas;
    const width = canvas.width = Math.round(canvas.clientWidth * ratio);
    const height = canvas.height = Math.round(canvas.clientHeight * ratio);
    const context = canvas.getContext("2d");
    const x = (i) => i / count * width, step = Math.max(1, width / count);
    const y = (v) => height - 3 * ratio - v / chart.top * (height - 16 * ratio);
    if (chart.kind === "strip") {
      chart.values.forEach(function (status, i) {
        context.fillStyle = colourOf(status);
        context.fillRect(x(i), 0, step + 0.5, height - 10 * ratio);
      });
      context.fillStyle = css("--ink");
      frames.key.forEach((i) =>
        context.fillRect(x(i + 0.5) - ratio / 2, height - 8 * ratio, ratio, 8 * ratio));
    } else if (chart.kind === "bars") {
      const keys = new Set(frames.key);
      chart.values.forEach(function (value, i) {
        context.fillStyle = keys.has(i) ? css("--link") : css("--soft") + "99";
        if (value !== null) context.fillRect(x(i), y(value), step, height - y(value));
      });
    } else {
      context.strokeStyle = css("--link");
      context.lineWidth = 1.5 * ratio;
      context.beginPath();
      let open = false;
      chart.values.forEach(function (value, i) {
        if (value === null) { open = false; return; }
        if (open) context.lineTo(x(i + 0.5), y(value)); else context.moveTo(x(i + 0.5), y(value));
        open = true;
      });
      context.stroke();
    }
    if (chart.kind !== "strip") {
      context.fillStyle = css("--soft");
      context.font = 11 * ratio + "px sans-serif";
      context.fillText(Number(chart.top.toPrecision(3)) + "", 5 * ratio, 12 * ratio);
    }
    const line = function (i, colour) {
      context.fillStyle = colour;
      context.fillRect(x(i + 0.5) - ratio / 2, 0, ratio, height);
    };
    if (shown >= 0) line(keyframes[shown].frame, "#e07b2a");
    if (pointed >= 0) line(pointed, css("--ink"));
  }

  const readout = document.getElementById("readout"), hint = readout.textContent;
  function drawAll() {
    charts.forEach(draw);
    if (pointed < 0) { readout.textContent = hint; return; }
    const i = pointed, parts = ["frame " + i + ", " + frames.time[i].toFixed(3) + " s",
      data.statuses[frames.status[i]] + (frames.reasons[i] ? " (" + frames.reasons[i] + ")" : ""),
      frames.inliers[i] + " points seen"];
    if (frames.ms[i] !== null) parts.push(frames.ms[i].toFixed(2) + " ms");
    if (frames.error && frames.error[i] !== null)
      parts.push(frames.error[i].toPrecision(3) + " " + data.truth_unit + " off");
    readout.textContent = parts.join("; ");
  }

  function nearestKeyframe(frame) {
    let best = -1;
    keyframes.forEach(function (key, k) {
      if (best < 0 || Math.abs(key.frame - frame) < Math.abs(keyframes[best].frame - frame)) best = k;
    });
    return best;
  }

  // The keyframe's picture with the tracks of the points that it sees, through the keyframes before
  // it: warm colours were seen often.
  const canvas = document.getElementById("keyframe");
  function select(k) {
    if (k < 0 || k >= keyframes.length || !canvas) return;
    shown = k;
    const key = keyframes[k];
    document.getElementById("keyframe-slider").value = k;
    document.getElementById("keyframe-words").textContent = "Keyframe " + key.id + ": frame " +
      key.frame + " (" + key.name + "), " + key.time.toFixed(3) + " s, sees " + key.tracks.length +
      " points of the map.";
    canvas.width = 2 * key.width;
    canvas.height = 2 * key.height;
    const context = canvas.getContext("2d");
    const paint = function () {
      context.lineWidth = 1.6;
      key.tracks.forEach(function (track) {
        const hue = Math.max(0, 210 - 30 * (track.length / 2 - 1));
        context.strokeStyle = context.fillStyle = "hsl(" + hue + " 90% 60%)";
        context.beginPath();
        for (let i = 0; i < track.length; i += 2)
          context[i ? "lineTo" : "moveTo"](2 * track[i] + 1, 2 * track[i + 1] + 1);
        context.stroke();
        context.fillRect(2 * track[0] - 2, 2 * track[1] - 2, 5, 5);
      });
    };
    const image = new Image();
    image.onload = function () {
      if (shown !== k) return;
      context.drawImage(image, 0, 0, canvas.width, canvas.height);
      paint();
    };
    image.src = "data:image/jpeg;base64," + key.image;
    if (window.cloudData) {
      window.cloudData.cameras.forEach(function (camera) {
        camera.colour = camera.id === key.id ? "#ffb260" : "#8fa3b8";
      });
      window.dispatchEvent(new Event("cloud-changed"));
    }
    drawAll();
  }
  if (canvas) {
    const slider = document.getElementById("keyframe-slider");
    slider.max = keyframes.length - 1;
    slider.addEventListener("input", () => select(Number(slider.value)));
    document.getElementById("keyframe-back").addEventListener("click", () => select(shown - 1));
    document.getElementById("keyframe-on").addEventListener("click", () => select(shown + 1));
    select(keyframes.length - 1);
  }
  window.addEventListener("resize", drawAll);
  drawAll();
})();
