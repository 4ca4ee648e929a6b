"""The page's own HTML, style and script; names in double braces are filled in by `view`.

The script keeps no clock: it reads the viewer's animation time in every frame and shows what
belongs to it, so playing, dragging the slider and the viewer's own controls all agree.
"""

from __future__ import annotations

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data: blob:;
 script-src 'unsafe-inline'; style-src 'unsafe-inline'; connect-src data: blob:; worker-src blob:">
<title>{{TITLE}}</title>
<!-- The viewer below is MeshCat with three.js, dat.GUI and others, all under the MIT licence. -->
<style>
  body { margin: 0; font: 15px/1.45 system-ui, "DejaVu Sans", sans-serif; color: #1b2430; }
  #stage { width: 100vw; height: 100vh; overflow: hidden; }
  .card { position: absolute; left: 16px; background: rgba(255, 255, 255, .88);
          border-radius: 8px; padding: 10px 14px; box-shadow: 0 1px 6px rgba(0, 0, 0, .18); }
  #legend { top: 16px; font-size: 13px; }
  #legend h1 { font-size: 17px; margin: 0 0 6px; }
  #legend ul { list-style: none; margin: 0; padding: 0; }
  #legend small { color: #66707c; }
  #legend i { display: inline-block; width: 14px; height: 10px; margin-right: 8px;
              border-radius: 2px; }
  #signals { left: auto; right: 16px; top: 48px; font-size: 13px; display: none; }
  #signals figure { margin: 0 0 8px; }
  #signals img { display: block; width: 132px; image-rendering: pixelated; border-radius: 3px; }
  #signals b { font-weight: 600; }
  #caption { bottom: 16px; right: 16px; max-width: 900px; margin: 0 auto; }
  #caption b { font-size: 17px; }
  #said { white-space: pre-line; min-height: 5.9em; margin-bottom: 4px; }
  #bar { display: flex; gap: 12px; align-items: center; }
  #bar input { flex: 1; }
  #bar button { width: 6em; font: inherit; }
  #now { width: 8em; text-align: right; font-variant-numeric: tabular-nums; }
</style>
</head>
<body>
<div id="stage"></div>
<div id="legend" class="card"><h1>{{TITLE}}</h1><ul>{{LEGEND}}</ul>
  <small>drag to turn, wheel to zoom</small></div>
<div id="signals" class="card"></div>
<div id="caption" class="card">
  <b id="head"></b><div id="said"></div>
  <div id="bar"><button id="play">Pause</button>
    <input id="time" type="range" min="0" step="0.01" list="touches" aria-label="time">
    <datalist id="touches"></datalist><span id="now"></span></div>
</div>
<script>{{VIEWER}}</script>
<script>
"use strict";
const byId = (id) => document.getElementById(id);
const captions = {{CAPTIONS}}, duration = {{DURATION}}, signals = {{SIGNALS}};
const viewer = new MeshCat.Viewer(byId("stage"));
for (const command of {{COMMANDS}}) {
  viewer.handle_command_bytearray(Uint8Array.from(atob(command), (c) => c.charCodeAt(0)));
}
// The viewer's camera turns about a point of three.js's world, where y is up and z towards us.
const inViewer = ([x, y, z]) => [x, z, -y];
viewer.camera.position.set(...inViewer({{EYE}}));
viewer.camera.zoom = 1.4;
viewer.controls.target.set(...inViewer({{TARGET}}));
const player = viewer.animator, slider = byId("time");
slider.max = duration;
for (const touch of {{MARKS}}) {
  byId("touches").appendChild(document.createElement("option")).value = touch;
}
function goTo(time) {
  player.pause();
  player.seek(time);
  player.display_progress(time);
}
function playOrPause() {
  if (player.playing) { player.pause(); return; }
  if (player.time >= duration - 0.02) { player.reset(); }
  player.play();
}
let shown = "";
function showSignals(now) {
  const last = new Map();
  for (const signal of signals) {
    if (signal.time <= now + 1e-6) { last.set(signal.finger, signal); }
  }
  const key = [...last.values()].map((s) => s.finger + s.time).join();
  if (key === shown) { return; }
  shown = key;
  byId("signals").style.display = last.size ? "block" : "none";
  byId("signals").replaceChildren(...[...last.values()].map((signal) => {
    const figure = document.createElement("figure"), image = new Image();
    const name = document.createElement("b"), words = document.createElement("span");
    image.src = signal.image;
    image.alt = "what the " + signal.finger + " felt";
    name.textContent = signal.finger;
    words.textContent = " " + signal.words;
    figure.append(image, name, words);
    return figure;
  }));
}
function show() {
  const now = player.time;
  showSignals(now);
  const caption = captions.filter((c) => c.time <= now + 1e-6).pop() || captions[0];
  if (byId("head").textContent !== caption.head) {
    byId("head").textContent = caption.head;
    byId("said").textContent = caption.body;
  }
  slider.value = now;
  byId("now").textContent = now.toFixed(1) + " / " + duration.toFixed(1) + " s";
  byId("play").textContent = player.playing ? "Pause" : "Play";
  requestAnimationFrame(show);
}
slider.addEventListener("input", () => goTo(Number(slider.value)));
byId("play").addEventListener("click", playOrPause);
const wanted = /#t=([0-9.]+)/.exec(location.hash);
if (wanted) { goTo(Number(wanted[1])); }
show();
</script>
</body>
</html>
"""
