"use strict";
// Shows what the server pushes. Every act is a form that also works without this script.

const KEPT = 10; // traces that are drawn: many take longer than a hit on a busy computer
const SILENCE = 2000; // [ms] after which what is shown is old: the server speaks four times a second
const READING = 1000; // [ms] in which nobody has read a new sentence: Enter does nothing
const MOST_ACTS = 3; // under way at once: a browser has six connections, and STOP needs one
const STOP_KEYS = ["Escape", "F12", "Pause"]; // the last two are what pedals send
const byId = (id) => document.getElementById(id);
const nameOf = (form) => form.dataset.key ?? form.getAttribute("action");
const root = document.documentElement;
const traces = new Map(); // of the sample under test, by record
let socket = null;
let lastWord = Date.now(); // when the browser asked for what is shown
let clockOffset = 0; // of the server's clock [ms]
let seen = ""; // what acts are made from
let sentence = ""; // number of the one shown
let newSince = -Infinity; // when it came
let shown = null; // record of the trace in front
let waiting = { fragments: {}, traces: [] }; // came while this browser was asleep

// What the server says: fragments of the page by id, as text; traces as bytes. Each message answers
// to the word that the one before is shown: by that word's time the browser knows how old it is.
function connect() {
  socket = new WebSocket(location.href.replace(/^http/, "ws").replace(/[^/]*$/, "live"));
  socket.binaryType = "arraybuffer";
  const say = (what) => socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(what));
  socket.onopen = () => { say({ shown: Date.now() }); pushStop(); };
  socket.onmessage = ({ data }) => {
    if (data instanceof ArrayBuffer) return waiting.traces.push(data);
    const news = JSON.parse(data);
    if (news.all) waiting.fragments = {};
    Object.assign(waiting.fragments, news.fragments);
    waiting.all ||= news.all;
    if (Date.now() - Number(news.answers) < SILENCE) show(news);
    say({ shown: Date.now() });
  };
  socket.onclose = () => setTimeout(connect, 500);
}

function show(news) {
  lastWord = Number(news.answers);
  clockOffset = news.now - Date.now();
  seen = news.seen;
  const { fragments, all } = waiting;
  if (all) byId("rows").querySelectorAll("tr").forEach((row) => row.id in fragments || row.remove());
  const before = sentence;
  sentence = seen.split(" ")[0];
  if (before !== sentence) newSince = performance.now();
  for (const [id, html] of Object.entries(fragments)) replace(id, html);
  waiting.traces.forEach(takeTrace);
  waiting = { fragments: {}, traces: [] };
  mark();
  if (before && before !== sentence) beep();
  if (news.stops.includes(stop)) endStop();
  check();
}

function replace(id, html) {
  if (html === null) return byId(id)?.remove();
  const place = byId(id) || addRow(id);
  const fresh = place.cloneNode(false);
  fresh.innerHTML = html;
  morph(place, fresh);
  if (id === "verdict") {
    const spoken = place.querySelector("[data-spoken]")?.dataset.spoken ?? "";
    if (!spoken) traces.clear();
    speak(spoken);
    requestAnimationFrame(draw); // where there was no room before
  }
}

function addRow(id) {
  const row = document.createElement("tr");
  row.id = id;
  const number = (it) => Number(it.id.slice(4));
  const older = [...byId("rows").children].find((it) => number(it) < number(row));
  byId("rows").insertBefore(row, older ?? null);
  return row;
}

// Makes one element like another: what is the same stays, with its focus, what is typed or open.
function morph(place, fresh) {
  for (const { name } of [...place.attributes]) {
    if (!fresh.hasAttribute(name) && name !== "open" && name !== "disabled") place.removeAttribute(name);
  }
  for (const { name, value } of fresh.attributes) {
    if (place.getAttribute(name) !== value) place.setAttribute(name, value);
  }
  const name = (it) => it.nodeName + (it.dataset?.key ?? it.id ?? "");
  const left = [...place.childNodes];
  for (const child of [...fresh.childNodes]) {
    const same = left.findIndex((it) => name(it) === name(child));
    if (same < 0) {
      place.insertBefore(child, left[0] ?? null);
      continue;
    }
    left.splice(0, same).forEach(drop);
    const kept = left.shift();
    if (kept.nodeType !== Node.ELEMENT_NODE) kept.nodeValue !== child.nodeValue && (kept.nodeValue = child.nodeValue);
    else morph(kept, child);
  }
  left.forEach(drop);
}
function drop(place) { // but not what somebody types in
  const typed = document.activeElement;
  if (!(place.contains(typed) && typed.matches("input:not([type=checkbox])") && typed.value)) place.remove();
}

// Seconds left, and whether what is shown is true: else the page says so, as large as the sentence.
function check() {
  const isOld = Date.now() - lastWord > SILENCE;
  const isLost = stop && Date.now() - stopAsked > 1000;
  root.classList.toggle("silent", isOld);
  if (isOld) alarm("NO CONNECTION: KEEP AWAY", seen ? "What is shown below is old. Use the switch." : "The page waits for the rig.");
  else if (isLost) alarm("STOP IS NOT CONFIRMED: keep away, use the switch", "It is sent again until the hammer answers.");
  else alarm("");
  byId("sent").textContent = isLost || isOld ? "NOT CONFIRMED: use the switch" : "SENT";
  byId("sent").hidden = !stop;
  byId("stopped").hidden = Boolean(stop);
  const say = byId("say").firstElementChild;
  const until = Number(say?.dataset.until);
  if (until) say.querySelector(".left").textContent = ` · ${Math.max(0, Math.ceil((until - Date.now() - clockOffset) / 1000))} s`;
}
function alarm(headline, detail = "") {
  const place = byId("alarm");
  if (place.firstElementChild.textContent !== headline) place.firstElementChild.textContent = headline;
  place.lastElementChild.textContent = detail;
  if (!place.hidden && !headline) newSince = performance.now();
  place.hidden = !headline;
  byId("say").hidden = Boolean(headline);
}
setInterval(check, 100);

// STOP: over the open WebSocket and as a form, at once; again until the server has the hammer's word.
let stop = sessionStorage.getItem("stop") ?? "";
let stopAsked = Date.now();
let isStopUnderWay = false;
function askStop() {
  if (!stop) stopAsked = Date.now();
  stop ||= `${Date.now()}-${Math.random()}`;
  sessionStorage.setItem("stop", stop);
  pushStop();
  check();
}
function pushStop() {
  if (!stop) return;
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ stop }));
  if (isStopUnderWay) return;
  isStopUnderWay = true;
  const options = { method: "POST", body: new URLSearchParams({ stop }), headers: { Accept: "application/json" }, keepalive: true, signal: AbortSignal.timeout(1500) };
  const asked = stop;
  fetch("stop", options).then((answer) => answer.json()).then(({ done }) => done && stop === asked && endStop())
    .catch(() => {}).finally(() => { isStopUnderWay = false; });
}
function endStop() {
  stop = "";
  sessionStorage.removeItem("stop");
  check();
}
setInterval(pushStop, 300);

// All other acts, without loading the page again. What is under way cannot be asked for again.
const underWay = new Set();
async function send(form, button) {
  const name = nameOf(form);
  if (underWay.has(name)) return;
  if (underWay.size >= MOST_ACTS) return tell("Wait: the rig has not answered to what you did before.");
  const body = new URLSearchParams(new FormData(form, button));
  body.set("seen", seen);
  underWay.add(name);
  mark();
  try {
    const answer = await fetch(form.action, { method: "POST", body, headers: { Accept: "application/json" }, signal: AbortSignal.timeout(12000) });
    if (!answer.headers.get("Content-Type").includes("json")) throw new Error(await answer.text());
    const { done, message } = await answer.json();
    tell(done ? "" : message);
    if (done) form.querySelectorAll("input[name=text], input[name=reason]:not([type=hidden])").forEach((input) => { input.value = ""; });
    if (done && name === "who") socket.close(); // it had the name before
    if (done) form.closest("details")?.removeAttribute("open");
  } catch (error) {
    tell(`Not known whether it is done (${error.message}): look.`);
  } finally {
    underWay.delete(name);
    mark();
  }
}
function mark() {
  document.querySelectorAll("form:not(#stop) button").forEach((it) => { it.disabled = underWay.has(nameOf(it.form)); });
}
function tell(text) { byId("answer").textContent = text; }
addEventListener("submit", (event) => {
  event.preventDefault();
  if (event.target.id === "stop") askStop();
  else send(event.target, event.submitter);
});

// Keys. Those of STOP are so everywhere; space where nothing is focused; the others outside of text.
addEventListener("keydown", (event) => {
  const { key, target } = event;
  const isFree = !target.closest("a, button, input, select, textarea, summary");
  const isText = target.matches("input:not([type=checkbox]), textarea");
  const isModified = event.ctrlKey || event.altKey || event.metaKey;
  if (STOP_KEYS.includes(key) || (key === " " && isFree)) {
    event.preventDefault();
    return askStop();
  }
  if (byId("say").querySelector("[data-countdown]") && !byId("say").hidden && !event.repeat) {
    event.preventDefault();
    return press("P");
  }
  if (key === "Enter" && !isText && !target.closest("#stop") && (event.repeat || performance.now() - newSince < READING)) {
    event.preventDefault();
    return tell("Too soon: read the new sentence first, then press Enter.");
  }
  if (event.repeat || isText || isModified) return;
  if (key.toUpperCase() === "R" && byId("reject")) byId("reject").open = !byId("reject").open;
  else if (key === "Enter" ? isFree : key.length === 1) press(key === "Enter" ? key : key.toUpperCase());
}, true);
function press(key) {
  const button = document.querySelector(`button[data-press="${CSS.escape(key)}"]`);
  const list = button?.closest("details");
  if (!list || list.open) button?.click();
}

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

function draw() {
  const front = traces.get(shown);
  if (!front) return document.querySelectorAll("canvas").forEach((it) => { it.width = it.width; }); // clears it
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
      const polyline = (values) => Array.from(values, (value, i) => [((i >> 1) + 0.5) * width / view.columns, y(value)]);
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

// A tone for each new sentence, and each verdict in words, if wanted.
const TONES = { go: 880, ask: 660, good: 1175, bad: 220, stopped: 160, paused: 330, done: 990 };
let sounds = null;
let spokenLast = "";
byId("sound").addEventListener("change", (event) => { sounds = event.target.checked ? new AudioContext() : null; });
function beep() {
  const kind = [...byId("say").firstElementChild.classList].find((name) => name in TONES);
  if (!sounds || !kind) return;
  const tone = sounds.createOscillator();
  tone.frequency.value = TONES[kind];
  tone.connect(sounds.destination);
  tone.start();
  tone.stop(sounds.currentTime + 0.15);
}
function speak(text) {
  const isNew = text && text !== spokenLast;
  spokenLast = text;
  if (isNew && byId("voice").checked) speechSynthesis.speak(new SpeechSynthesisUtterance(text.replace(/^.*?: /, "")));
}

root.classList.add("live");
check();
connect();
