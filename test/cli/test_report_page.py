#!/usr/bin/env python3
"""Tests of report.html in a browser, headless Chromium: on a phone, and the cloud's first view."""
import json
import re
import shutil
import subprocess
import sys
import unittest

import cli_support as cli

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
# Runs in the page and leaves what it finds in an element. The points are read from the pixels,
# since the cloud's script hides its variables.
PROBE = """<script>window.addEventListener("load", () => setTimeout(() => {
  const canvas = document.getElementById("cloud");
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const near = (i, r, g, b) => Math.abs(pixels[i] - r) + Math.abs(pixels[i + 1] - g) +
    Math.abs(pixels[i + 2] - b) < 12;
  const found = {orange: 0, lit: 0, inner: innerWidth,
                 wide: document.documentElement.scrollWidth,
                 boxes: [...document.querySelectorAll(".matrices pre")].map(
                   (box) => [box.getBoundingClientRect().right,
                             box.scrollWidth > box.clientWidth])};
  for (let i = 0; i < pixels.length; i += 4) {
    found.orange += near(i, 255, 178, 96);
    found.lit += pixels[i] > 80 && pixels[i + 1] > 80 && pixels[i + 2] > 80;
  }
  const probe = document.createElement("pre");
  probe.id = "probe";
  probe.textContent = JSON.stringify(found);
  document.body.append(probe);
}, 50));</script>"""


class Page(cli.CliTest):
    def probed(self, page, width):
        """What the probe finds in the page at this width."""
        text = page.read_text(errors="replace").replace("</body>", PROBE + "</body>")
        # Chromium's windows are at least 500 pixels wide; a frame may be of any width.
        inner = self.write("inner.html", text)
        html = (f'<!doctype html><body><iframe id="f" src="{inner.name}" width="{width}" '
                'height="800"></iframe><script>addEventListener("load", () => setTimeout(() => {'
                'document.title = document.getElementById("f").contentDocument'
                '.getElementById("probe").textContent; }, 600));</script>')
        outer = self.write("outer.html", html)
        done = subprocess.run(
            [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu",
             "--allow-file-access-from-files", "--force-prefers-reduced-motion",
             "--window-size=1300,900", "--virtual-time-budget=4000",
             f"--user-data-dir={self.folder}/profile", "--dump-dom", outer.as_uri()],
            capture_output=True, timeout=120)
        title = re.search(r"<title>(.*?)</title>", done.stdout.decode())
        self.assertIsNotNone(title, done.stderr.decode()[-2000:])
        return json.loads(title.group(1))

    def test_the_page_fits_a_phone_and_its_matrices_scroll_in_their_boxes(self):
        self.succeed(self.reconstruct())
        for width in (320, 390):
            found = self.probed(self.out / "report.html", width)
            with self.subTest(width=width):
                self.assertLessEqual(found["wide"], found["inner"])
                self.assertTrue(all(right <= found["inner"] for right, _ in found["boxes"]))
        self.assertTrue(any(scrolls for _, scrolls in found["boxes"]))

    def test_cameras_are_in_the_first_view_and_dark_points_are_seen(self):
        # The same pair, nearly black.
        self.a, self.b = (self.write(f"{name}.png", cli.png(cli.WIDTH, cli.HEIGHT, bytes(
            v // 3 for v in image))) for name, image in zip("ab", cli.stereo_pair()))
        self.succeed(self.reconstruct())
        for width in (390, 1200):
            found = self.probed(self.out / "report.html", width)
            with self.subTest(width=width):
                self.assertGreater(found["orange"], 20)
                self.assertGreater(found["lit"], 500)


class Printed(cli.CliTest):
    def test_nothing_is_cut_or_folded_on_paper(self):
        """The print style on the screen, and the event that a browser sends before it prints."""
        self.succeed(self.reconstruct())
        page = (self.out / "report.html").read_text(errors="replace")
        page = page.replace("@media print", "@media all")
        probe = """<script>addEventListener("load", () => setTimeout(() => {
          const count = () => document.querySelectorAll("details:not([open])").length;
          const before = count();
          dispatchEvent(new Event("beforeprint"));
          const cut = (e) => e.scrollWidth > e.clientWidth + 1 ||
            e.scrollHeight > e.clientHeight + 1;
          const shown = (e) => e.getClientRects().length > 0;
          const found = {before: before, during: count(),
            cut: [...document.querySelectorAll("pre, table, .card, .stage")].filter(cut).length,
            buttons: [...document.querySelectorAll("button")].filter(shown).length,
            json: document.querySelector("details pre").getBoundingClientRect().height};
          dispatchEvent(new Event("afterprint"));
          found.after = count();
          document.title = JSON.stringify(found);
        }, 100));</script>"""
        path = self.write("print.html", page.replace("</body>", probe + "</body>"))
        common = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu",
                  "--virtual-time-budget=3000", f"--user-data-dir={self.folder}/profile"]
        done = subprocess.run([*common, "--window-size=700,900", "--dump-dom", path.as_uri()],
                              capture_output=True, timeout=120)
        title = re.search(r"<title>(.*?)</title>", done.stdout.decode()).group(1)
        found = json.loads(title)
        self.assertEqual((found["before"], found["during"], found["after"]), (1, 0, 1))
        self.assertEqual((found["cut"], found["buttons"]), (0, 0))
        self.assertGreater(found["json"], 2000)
        # As PDF: the numbers and the whole of result.json are several pages more.
        pdf = self.folder / "report.pdf"
        subprocess.run([*common, f"--print-to-pdf={pdf}", (self.out / "report.html").as_uri()],
                       capture_output=True, timeout=120, check=True)
        self.assertGreaterEqual(len(re.findall(rb"/Type /Page\b(?!s)", pdf.read_bytes())), 6)


if __name__ == "__main__":
    if not CHROMIUM:
        print("skipped: there is no Chromium")
        sys.exit(cli.SKIP_CODE)
    cli.main()
