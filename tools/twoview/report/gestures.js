// What fingers, mouse and wheel do on a canvas, as calls of `on`: hold() when anything begins,
// turn(dx, dy) and shift(dx, dy) in pixels, zoom(factor), click(x, y) in pixels of the canvas as it
// is laid out: a press and a release without a way between.
window.twoviewGestures = function (canvas, on) {
  "use strict";
  const held = new Map();
  let way = 0;
  canvas.addEventListener("pointerdown", function (event) {
    on.hold();
    canvas.setPointerCapture(event.pointerId);
    held.set(event.pointerId, [event.clientX, event.clientY]);
    way = held.size === 1 ? 0 : Infinity;
  });
  canvas.addEventListener("pointermove", function (event) {
    const last = held.get(event.pointerId);
    if (!last) return;
    const dx = event.clientX - last[0], dy = event.clientY - last[1];
    way += Math.abs(dx) + Math.abs(dy);
    if (held.size === 2) {
      const other = [...held].find(([id]) => id !== event.pointerId)[1];
      const before = Math.hypot(last[0] - other[0], last[1] - other[1]);
      const after = Math.hypot(event.clientX - other[0], event.clientY - other[1]);
      if (before > 0) on.zoom(after / before);
    } else if (event.shiftKey || event.buttons & 6) {
      on.shift(dx, dy);
    } else {
      on.turn(dx, dy);
    }
    held.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointerup", function (event) {
    held.delete(event.pointerId);
    if (way > 4 || !on.click) return;
    const box = canvas.getBoundingClientRect();
    on.click(event.clientX - box.left, event.clientY - box.top);
  });
  canvas.addEventListener("pointercancel", (event) => held.delete(event.pointerId));
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", function (event) {
    event.preventDefault();
    on.hold();
    on.zoom(Math.exp(-0.0012 * event.deltaY));
  }, { passive: false });
};
