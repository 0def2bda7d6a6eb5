#!/bin/sh
# dji-telemetry reads a height below the place of take-off as 0, and never the absolute one.
#
# Package: dji-telemetry 1.0.1 (Python 3.11, Linux x86-64). Run on 2026-11-29.
# DJI's subtitles say "[rel_alt: -12.500 abs_alt: 87.500]": metres above take-off, negative where the
# drone flies down a slope, and above the sea. Two frames, the second 25 m higher, which no drone
# climbs in 33 ms; the numbers are made up, the form is DJI's.
# Expected: rel_alt -12.5 and 12.5, abs_alt 87.5 and 112.5. Seen: rel_alt 0 and 12.5, abs_alt 0 and 0,
# so the vertical speed that it derives is half of what the file says.
# What helps: reading the two numbers of the bracket oneself, with their sign.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check dji-telemetry==1.0.1
cd "$work"
cat > run.py <<'EOF'
import dji_telemetry

FRAME = """{n}
00:00:00,{start:03} --> 00:00:00,{end:03}
<font size="28">FrameCnt: {n}, DiffTime: 33ms
2024-01-01 10:00:00.{start:03}
[iso: 100] [shutter: 1/500.0] [fnum: 2.8] [ev: 0] [focal_len: 24.00] [latitude: 1.000000] \
[longitude: 2.000000] [rel_alt: {rel:.3f} abs_alt: {alt:.3f}] </font>

"""
with open("x.srt", "w") as file:
    file.write(FRAME.format(n=1, start=0, end=33, rel=-12.5, alt=87.5))
    file.write(FRAME.format(n=2, start=33, end=66, rel=12.5, alt=112.5))
for frame in dji_telemetry.parse_srt("x.srt").frames:
    print("rel_alt", float(frame.rel_alt), "abs_alt", float(frame.abs_alt))
EOF
"$work/venv/bin/python" run.py > seen
cat > expected <<'EOF'
rel_alt 0.0 abs_alt 0.0
rel_alt 12.5 abs_alt 0.0
EOF
cat seen
diff expected seen
