"""The page of `stage`: its words, its looks and its script."""

from __future__ import annotations

START = "Start with the hand where the blue arm is, fingers down."
WHAT_TO_DO = {
    "reach": f"""Put something small and colourful where the orange outline is, such as a bottle cap
on a stand. {START} Bring the finger tips to it, and stay there for a moment.""",
    "push": f"""Put a small box or a can where the solid orange outline is. {START} Come down behind
the object and push it along the table to the dashed outline. Stay there for a moment.""",
    "slide": f"""Put something flat that slides well where the solid orange outline is, such as a
puck or a coaster. {START} Come down behind it and give it one hit, so that it slides on alone and
stops at the dashed outline. Keep recording until it rests.""",
    "coffee": f"""Put a mug where the solid orange outline is, and something tall where the machine
is. {START} Come down behind the mug and push it under the machine, to the dashed outline. Stay
there for a moment.""",
    "drawer": f"""Open a drawer, or stand a box on the table, with its front at the left end of the
solid orange outline. {START} Push the front with the finger tips until it is where the dashed
outline begins. Stay there for a moment.""",
}

ANY_TASK = {  # of a new one: whether an object has to get somewhere -> what to do
    False: WHAT_TO_DO["reach"],
    True: f"""Put something of the object's size where the solid orange outline is. {START} Bring it
to the dashed outline as the task has it. Stay there for a moment.""",
}

ORANGE = {  # whether a goal is drawn -> what is orange
    False: "the thing to reach",
    True: "the object, and dashed the place it has to get to",
}

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:;
 style-src 'unsafe-inline'; script-src 'unsafe-inline'; media-src blob:; connect-src blob:">
<title>Film your arm: {task}</title>
<style>
:root { color-scheme: light dark; --edge: #888; --panel: #f2f4f7 }
@media (prefers-color-scheme: dark) { :root { --panel: #23272e } }
* { box-sizing: border-box }
body { margin: 0 auto; max-width: 60rem; padding: 1rem; font: 1rem/1.5 system-ui, sans-serif }
h1 { font-size: 1.5rem; margin: .3rem 0 .6rem }
.stage { position: relative; background: #000; aspect-ratio: 4 / 3; border-radius: 8px;
         margin: 0 auto; overflow: hidden }
.stage video, .stage svg { position: absolute; inset: 0; width: 100%; height: 100%;
         object-fit: contain }
.stage svg { pointer-events: none; opacity: var(--shown, .9) }
path { fill: none; stroke-width: .55; stroke-linejoin: round }
.scene { stroke: #ccc; stroke-width: .3 }
.arm { stroke: #56B4E9 }
.object { stroke: #E69F00 }
.goal { stroke: #E69F00; stroke-dasharray: 1.6 1.2 }
#count { position: absolute; inset: 0; display: grid; place-items: center; font-size: 7rem;
         color: #fff; text-shadow: 0 0 1rem #000 }
.bar { display: flex; flex-wrap: wrap; gap: .6rem; align-items: center; margin: .8rem 0 }
button, .bar a { font: inherit; padding: .55rem 1.1rem; border: 1px solid var(--edge);
         border-radius: 8px; background: var(--panel); color: inherit; text-decoration: none }
button:disabled { opacity: .45 }
#record { background: #b3261e; color: #fff; border-color: #b3261e }
#told { min-height: 1.5em }
pre { white-space: pre-wrap; background: var(--panel); border-radius: 8px; padding: .7rem .9rem }
pre > span { display: inline-block; max-width: 100%; overflow-wrap: anywhere }
[hidden] { display: none !important }
</style>
</head>
<body data-state="starting">
<main>
<h1>Film your arm: {task}</h1>
<p>{what}</p>
<div class="stage">
<video id="live" autoplay muted playsinline aria-label="The camera's picture"></video>
<video id="film" loop playsinline hidden aria-label="What was recorded"></video>
<svg viewBox="0 0 {size} {size}" role="img"
 aria-label="Outline of the scene">
{outlines}
</svg>
<div id="count" aria-hidden="true"></div>
</div>
<div class="bar">
<button id="record" disabled>Record</button>
<button id="stop" hidden>Stop</button>
<button id="again" hidden>Again</button>
<a id="save" hidden>Save</a>
<label>Camera <select id="cameras"></select></label>
<label>Outline <input id="shown" type="range" min="0" max="1" step="0.05" value="0.9"></label>
</div>
<p id="told" role="status"></p>
<p>Blue: your arm. Orange: {orange}. Grey: the table and what stands on it.</p>
<p id="other" hidden><label>Film it with the camera's own app instead:
<input id="file" type="file" accept="video/*" capture="environment"></label></p>
<ul>
<li>Camera: to the side of the table, a little above it, and still. Lean it against something.</li>
<li>Arm: one, from the left, or from above as it is drawn; bare or in a sleeve, with nothing else
that moves in the picture. If it comes from the right, push to the left: the clip is mirrored.</li>
<li>Light: from the front, and enough of it. Hand, sleeve and object differ in colour from what is
behind them.</li>
<li>The outline is a help. A clip need not fit it exactly, but all of the way has to be in the
picture.</li>
<li>Nothing leaves this machine: the page has no way to send anything.</li>
</ul>
<p>Then, in a terminal in the kit's folder, with the path to the saved film, which most browsers put
into Downloads; from a phone the film has to get to the computer first:</p>
<pre><span>python -m tasks prepare {task}</span> <span
>PATH/TO/<span id="clip">CLIP</span></span></pre>
</main>
<script>
"use strict";
const NAME = {name}, LONGEST = 20, FORMATS = [
  ["video/mp4;codecs=avc1", "mp4"], ["video/webm;codecs=vp9", "webm"],
  ["video/webm;codecs=vp8", "webm"], ["video/webm", "webm"], ["video/mp4", "mp4"]];
const at = id => document.getElementById(id);
let stream, recorder, parts, clock;

function state(name, told) {
  document.body.dataset.state = name;
  at("told").textContent = told || "";
  at("record").hidden = !["starting", "live", "none"].includes(name);
  at("record").disabled = name !== "live";
  at("stop").hidden = name !== "recording";
  at("again").hidden = at("save").hidden = at("film").hidden = name !== "recorded";
  at("live").hidden = name === "recorded";
  document.querySelector(".stage svg").style.visibility = name === "recorded" ? "hidden" : "";
}

function none(why) {
  state("none", why);
  at("other").hidden = false;
}

async function start(id) {
  if (!navigator.mediaDevices || !window.MediaRecorder)
    return none("This browser gives a page that is a file no camera. On a phone that is usual.");
  state("starting", "Waiting for the camera. Allow it, if the browser asks.");
  if (stream) stream.getTracks().forEach(track => track.stop());
  const which = id ? {deviceId: {exact: id}} : {facingMode: "environment"};
  const size = {width: {ideal: 1280}, height: {ideal: 720}, frameRate: {ideal: 30}};
  try {
    stream = await navigator.mediaDevices.getUserMedia({video: {...which, ...size}, audio: false});
  } catch (error) {
    return none({
      NotAllowedError: "The camera was not allowed. Allow it in the address bar and load again.",
      NotFoundError: "No camera was found. Plug one in and load again.",
      NotReadableError: "The camera is in use by another program. Close that and load again.",
    }[error.name] || `No camera: ${error.message}`);
  }
  at("live").srcObject = stream;
  await at("live").play();
  const {videoWidth: width, videoHeight: height} = at("live");
  const stage = document.querySelector(".stage");  // all of it is the camera's picture
  Object.assign(stage.style, {aspectRatio: width / height, maxWidth: `${80 * width / height}vh`});
  const now = stream.getVideoTracks()[0].getSettings().deviceId;
  const all = await navigator.mediaDevices.enumerateDevices();
  const cameras = all.filter(device => device.kind === "videoinput");
  at("cameras").replaceChildren(...cameras.map(({label, deviceId}, i) =>
    new Option(label || `camera ${i + 1}`, deviceId, false, deviceId === now)));
  state("live", "Line up object and arm, then record. It counts to three first.");
}

async function record() {
  const known = FORMATS.find(([type]) => MediaRecorder.isTypeSupported(type));
  if (!known) return none("This browser cannot record; Chrome and Firefox can.");
  state("counting");
  for (const n of [3, 2, 1]) {
    at("count").textContent = n;
    await new Promise(done => setTimeout(done, 1000));
  }
  at("count").textContent = "";
  parts = [];
  recorder = new MediaRecorder(stream, {mimeType: known[0], videoBitsPerSecond: 8e6});
  recorder.ondataavailable = event => parts.push(event.data);
  recorder.onstop = () => recorded(known[1]);
  recorder.start(500);
  const from = Date.now();
  state("recording", "Recording.");
  clock = setInterval(() => {
    const passed = (Date.now() - from) / 1000;
    at("told").textContent = `Recording, ${passed.toFixed(0)} s.`;
    if (passed > LONGEST) recorder.stop();
  }, 250);
}

function recorded(ending) {
  clearInterval(clock);
  show(new Blob(parts, {type: recorder.mimeType}), `${NAME}.${ending}`);
}

function show(blob, name) {
  const url = URL.createObjectURL(blob);
  at("film").src = url;
  at("film").play();
  Object.assign(at("save"), {href: url, download: name});
  at("clip").textContent = name;
  const megabytes = (blob.size / 1e6).toFixed(1);
  state("recorded", `Recorded, ${megabytes} MB. Look at it, a tap stops it, and save it.`);
}

at("record").onclick = record;
at("stop").onclick = () => recorder.stop();
at("film").onclick = () => at("film").paused ? at("film").play() : at("film").pause();
at("again").onclick = () => stream ? state("live") : location.reload();
at("cameras").onchange = event => start(event.target.value);
at("shown").oninput = event =>
  document.querySelector(".stage").style.setProperty("--shown", event.target.value);
at("file").onchange = event => {
  const file = event.target.files[0];
  if (file) show(file, file.name);
};
start();
</script>
</body>
</html>
"""
