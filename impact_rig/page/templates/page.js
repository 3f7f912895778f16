"use strict";
// Shows what the server pushes. Every act is a form that also works without this script.

const KEPT = 10; // traces that are drawn: many take longer than a hit on a busy computer
const SILENCE = 3000; // [ms] after which the server counts as silent: it speaks every second
const byId = (id) => document.getElementById(id);
const root = document.documentElement;
const traces = new Map(); // of the sample under test, by record
let lastWord = performance.now();
let clockOffset = 0; // of the server's clock [ms]
let shown = null; // record of the trace in front
let sentence = "";

// What the server says: fragments of the page by id, as text; traces as bytes.
function connect() {
  const socket = new WebSocket(location.href.replace(/^http/, "ws").replace(/[^/]*$/, "live"));
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => {
    lastWord = performance.now();
    if (data instanceof ArrayBuffer) return takeTrace(data);
    const { now, fragments } = JSON.parse(data);
    clockOffset = now - Date.now();
    for (const [id, html] of Object.entries(fragments)) replace(id, html);
    byId("start").hidden = byId("hammer").querySelector("form[action=end]") !== null;
    check();
  };
  socket.onclose = () => setTimeout(connect, 500);
}

// A panel in which somebody types or presses waits until that is done.
const waiting = new Map();
let pressed = null; // what the pointer is down on
function replace(id, html) {
  const place = byId(id);
  const typed = place.contains(document.activeElement) && document.activeElement.matches("input");
  const busy = typed || (pressed && place.contains(pressed));
  if (busy || place.querySelector("details[open]")) return waiting.set(id, html);
  waiting.delete(id);
  const focused = place.contains(document.activeElement) ? document.activeElement.closest("form") : null;
  place.innerHTML = html;
  if (focused) place.querySelector(`form[action="${focused.getAttribute("action")}"] button`)?.focus();
  if (id === "say") beep();
  if (id === "verdict" && !place.querySelector("b")) forget();
}
addEventListener("pointerdown", (event) => { pressed = event.target; });
for (const end of ["pointerup", "pointercancel"]) {
  addEventListener(end, () => setTimeout(() => { pressed = null; waiting.forEach((html, id) => replace(id, html)); }));
}
addEventListener("focusout", () => setTimeout(() => waiting.forEach((html, id) => replace(id, html))));
addEventListener("toggle", () => waiting.forEach((html, id) => replace(id, html)), true);

// Seconds left, and whether the server still speaks.
function check() {
  const isSilent = performance.now() - lastWord > SILENCE;
  if (isSilent && !root.classList.contains("silent")) byId("answer").textContent = "No word from the rig: what is shown is old.";
  if (!isSilent && root.classList.contains("silent")) byId("answer").textContent = "";
  root.classList.toggle("silent", isSilent);
  const say = byId("say").firstElementChild;
  const until = Number(say?.dataset.until);
  if (until) say.querySelector(".left").textContent = ` · ${Math.max(0, Math.ceil((until - Date.now() - clockOffset) / 1000))} s`;
}
setInterval(check, 250);

// Acts, without loading the page again.
async function send(form, button) {
  const isStop = form.id === "stop";
  const body = new URLSearchParams(new FormData(form, button));
  try {
    const answer = await fetch(form.action, { method: "POST", body, headers: { Accept: "application/json" }, signal: AbortSignal.timeout(isStop ? 1500 : 20000) });
    const { done, message } = await answer.json();
    byId("answer").textContent = done && !isStop ? "" : message;
    if (isStop && !done) throw new Error(message);
    if (done) form.querySelectorAll("input:not([type=hidden])").forEach((input) => { if (form.matches(".overrule, [action=note]")) input.value = ""; });
    if (done) form.closest("details")?.removeAttribute("open");
  } catch (error) {
    byId("answer").textContent = isStop ? "NOT CONFIRMED: use the switch" : `not done: ${error.message}`;
    if (isStop) byId("stopped").textContent = "NOT CONFIRMED: use the switch";
  }
}
addEventListener("submit", (event) => {
  event.preventDefault();
  send(event.target, event.submitter);
});
addEventListener("keydown", (event) => {
  if (event.repeat || event.target.matches("input:not([type=checkbox])")) return;
  if (event.key === " ") {
    event.preventDefault();
    byId("stop").requestSubmit();
  } else if (!event.target.matches("button, summary, input")) {
    const key = event.key === "Enter" ? "Enter" : event.key.toUpperCase();
    document.querySelector(`button[data-key="${CSS.escape(key)}"]`)?.click();
  }
});

// Traces: a header in JSON, then for each view and channel the least and largest of each column.
function takeTrace(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const trace = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = 4 + length;
  for (const view of trace.views) {
    view.channels = trace.channels.map(() => {
      const values = new Float32Array(buffer, at, 2 * view.columns);
      at += values.byteLength;
      return values;
    });
  }
  if (traces.size && [...traces.values()][0].sample !== trace.sample) traces.clear();
  traces.set(trace.record, trace);
  if (traces.size > KEPT) traces.delete(traces.keys().next().value);
  shown = trace.record;
  requestAnimationFrame(draw);
}

function forget() {
  traces.clear();
  for (const canvas of document.querySelectorAll("canvas")) canvas.width = canvas.width; // clears it
}

function draw() {
  const front = traces.get(shown);
  if (!front) return;
  const colours = getComputedStyle(root);
  const colour = (name) => colours.getPropertyValue(`--${name}`);
  front.views.forEach((view, number) => {
    const canvas = byId(view.name);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const scale = devicePixelRatio || 1;
    [canvas.width, canvas.height] = [width * scale, height * scale];
    const pen = canvas.getContext("2d");
    pen.scale(scale, scale);
    pen.font = "12px system-ui";
    const half = (height - 18) / 2;
    front.channels.forEach((channel, index) => {
      const top = index * half;
      const [low, high] = channel.range;
      const y = (value) => top + half - 4 - ((value - low) / (high - low)) * (half - 22);
      for (const line of channel.lines) {
        if (line.value < low || line.value > high) continue;
        pen.setLineDash([3, 4]);
        stroke([[0, y(line.value)], [width, y(line.value)]], colour("ask"), 1);
        pen.setLineDash([]);
        label(line.name, width - 4, y(line.value) - 3, "right");
      }
      const polyline = (values) => {
        const points = [];
        for (let i = 0; i < view.columns; i++) {
          const x = (i + 0.5) * width / view.columns;
          points.push([x, y(values[2 * i])], [x, y(values[2 * i + 1])]);
        }
        return points;
      };
      for (const other of traces.values()) {
        if (other.accepted && other.record !== shown) stroke(polyline(other.views[number].channels[index]), colour("faint"), 3);
      }
      stroke(polyline(view.channels[index]), colour(index ? "sample" : "hammer"), 2);
      label(`${channel.name} ${channel.peak}`, 4, top + 12, "left");
    });
    label(view.axis, width - 4, height - 4, "right");

    function stroke(points, style, thickness) {
      pen.beginPath();
      points.forEach(([x, height]) => pen.lineTo(x, height));
      [pen.strokeStyle, pen.lineWidth, pen.lineJoin] = [style, thickness, "round"];
      pen.stroke();
    }
    function label(text, x, height, align) {
      [pen.fillStyle, pen.textAlign] = [colour("soft"), align];
      pen.fillText(text, x, height);
    }
  });
}
addEventListener("resize", () => requestAnimationFrame(draw));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);

// A tone for each new sentence, if wanted.
const TONES = { go: 880, ask: 660, good: 1175, bad: 220, stopped: 160, paused: 330, done: 990 };
let sounds = null;
byId("sound").addEventListener("change", (event) => { sounds = event.target.checked ? new AudioContext() : null; });
function beep() {
  const say = byId("say").firstElementChild;
  const kind = [...say.classList].find((name) => name in TONES);
  const [before, now] = [sentence, say.textContent];
  sentence = now;
  if (!sounds || !kind || before === now) return;
  const tone = sounds.createOscillator();
  tone.frequency.value = TONES[kind];
  tone.connect(sounds.destination);
  tone.start();
  tone.stop(sounds.currentTime + 0.15);
}

root.classList.add("live");
check();
connect();
