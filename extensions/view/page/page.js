// @ts-check
/**
 * The page from which one drives. What hands hold goes to the worker, which reports it; what the server says of the robot
 * is shown. The messages are those of protocol.py.
 */

import { Hands, stick } from "./hands.js";

const ASKED = 4000; // ms for which a button that asks twice waits
const TOLD = 5000; // ms for which a line is shown
const OLD = 500; // ms; a picture that is older is covered
const SLOW = 0.3; // s of delay from which the page says so
const POLL = 30; // ms between two looks at the gamepads and the picture's age
const SETTLES = 1000; // ms after a click on a box in which older states may come
const TOO_FEW = 2; // fields of a plot's axis
const ALARM = 1000; // ms after a stop in which the button still stops: a person in alarm presses it twice

/** The speeds of the three gears: m/s and rad/s. */
const GEARS = { slow: [0.15, 0.5], normal: [0.5, 1.0], fast: [1.0, 2.0] };

/**
 * @typedef {{
 *   robots: {name: string, state: string}[], robot: string, there: boolean, sim: boolean, driver: string,
 *   driver_name: string, stopped: string, held: boolean, lost: boolean, paused: boolean, waiting: string,
 *   refused: string, commanded: number[], measured: number[] | null, limits: number[], strafes: boolean, slows: boolean | null,
 *   limited: string,
 *   delay: number, pace: number | null, frames: number | null, view: string, cameras: string[], camera: string,
 *   picture: string, boxes: {label: string, on: boolean}[], frames_of: string[], frame: string, problems: string[],
 *   topics: string[], bag: [number, boolean] | null
 * }} State see protocol.py
 * @typedef {{ticket: string, look_only: boolean, bag: number | null, models: string[], speeds: number[],
 *   rates: number[]}} Welcome
 * @typedef {{text: string, bad?: boolean, acts?: [string, () => void][]}} Notice
 */

/** @param {string} id @returns {any} */
const $ = (id) => document.getElementById(id);
const now = () => performance.timeOrigin + performance.now();
const own = location.href.replace(/^http/, "ws").replace(/[?#].*$/, "").replace(/\/$/, "");

/** @type {State | null} */
let state = null;
/** @type {Welcome | null} */
let welcome = null;
/** @type {keyof typeof GEARS} */
let gear = "normal";
let link = "closed";
let linkWhy = "";
let isSwapped = false;
let byPicture = false;
let isHeld = false;
let dropped = "";
let clickFor = "";
/** @type {{age: number, sent: number} | null} the picture that is shown: its age in s when it was sent, after a time of ours in ms */
let shownPicture = null;
let toldUntil = 0;
/** @type {number | null} when the robot was first seen to be stopped, in ms; null: it is not */
let stoppedAt = null;

const worker = new Worker("/worker.js");
/** @param {object} message to the server */
const say = (message) => worker.postMessage({ do: "say", message });

// Driving.

const hands = new Hands((motion, press) => {
  if (motion && state) {
    isHeld = true;
    dropped = "";
    const [speed, rate] = speeds();
    worker.postMessage({ do: "hold", hold: { press, robot: state.robot, ...motion, speed, rate } });
  } else if (isHeld) {
    isHeld = false;
    worker.postMessage({ do: "let_go", press });
  }
  drawHands(motion);
}, () => stop());

stick($("move"), "move", hands);
stick($("ring"), "ring", hands);
stick($("thumb"), "turn", hands);

/** @returns {number[]} the speed and rate of the gear, within what robot and server allow */
function speeds() {
  return GEARS[gear].map((value, index) => {
    const [least, most] = (index ? welcome?.rates : welcome?.speeds) ?? [value, value];
    const limit = state?.limits[index] || Infinity;
    return Math.max(least, Math.min(value, limit, most));
  });
}

function stop() {
  hands.letGo();
  if (state?.robot && !welcome?.look_only) say({ type: "stop", robot: state.robot });
}

/** Whether a person writes or chooses there. @param {EventTarget | null} target */
const isInput = (target) => target instanceof HTMLSelectElement || target instanceof HTMLInputElement;

addEventListener("keydown", (event) => {
  if (event.code === "Space" || event.key === "Escape") {
    event.preventDefault();
    light("space", true);
    if (clickFor) endClick();
    else if (event.code === "Space" && !event.repeat) stop();
    return;
  }
  if (isInput(event.target) && event.key.startsWith("Arrow")) return;
  if (event.key === "k" || event.key === "K") {
    hands.letGo();
    light("k", true);
  } else if (hands.keyDown(event)) {
    event.preventDefault();
  } else if (/^[123]$/.test(event.key)) {
    shift(/** @type {any} */ (Object.keys(GEARS)[Number(event.key) - 1]));
  }
});
addEventListener("keyup", (event) => {
  light("space", false);
  light("k", false);
  hands.keyUp(event);
});
addEventListener("blur", () => {
  hands.away();
  // A click into the scene takes the keys there: the hold ends, and the keys come back at once for the next one.
  if (document.activeElement === $("frame")) setTimeout(() => { $("frame").blur(); window.focus(); });
});
document.addEventListener("visibilitychange", () => document.hidden && hands.away());
addEventListener("pagehide", () => hands.away());
addEventListener("gamepaddisconnected", () => hands.letGo());
document.addEventListener("freeze", () => hands.away());
addEventListener("click", (event) => event.detail && event.target instanceof HTMLButtonElement && event.target.blur());
addEventListener("change", (event) => event.target instanceof HTMLElement && event.target.blur());

/** @param {string} cap @param {boolean} on */
function light(cap, on) {
  for (const key of document.querySelectorAll("kbd")) {
    if (key.dataset.cap?.split(" ").includes(cap)) key.classList.toggle("lit", on);
  }
}

/** @param {{x: number, y: number, turn: number} | null} motion */
function drawHands(motion) {
  const lit = new Set([...hands.keys.values()].filter(Boolean));
  for (const key of document.querySelectorAll("kbd")) {
    const caps = key.dataset.cap?.split(" ") ?? [];
    if (!["space", "k"].includes(caps[0])) {
      key.classList.toggle("lit", caps.some((cap) => lit.has(cap)) || (caps[0] === "shift" && (lit.has("J") || lit.has("L"))));
    }
  }
  const at = motion ?? { x: 0, y: 0, turn: 0 };
  const reach = 37;
  $("knob").style.transform = `translate(${-at.y * reach}px, ${-at.x * reach}px)`;
  $("thumb-knob").style.transform = `translate(${-at.turn * reach}px, 0)`;
  $("grip").style.transform = `rotate(${-at.turn * 52}deg)`;
  $("move").classList.toggle("held", at.x !== 0 || at.y !== 0);
  $("ring").classList.toggle("held", at.turn !== 0);
  $("thumb").classList.toggle("held", at.turn !== 0);
}

/** @param {keyof typeof GEARS} to */
function shift(to) {
  gear = to;
  for (const button of $("pacing").children) button.setAttribute("aria-checked", String(button.dataset.pace === to));
  hands.update();
}
for (const button of $("pacing").children) button.onclick = () => shift(button.dataset.pace);

/** @type {string | null} what the button was when a finger came down on it: it is another one by the time it lifts */
let stopWas = null;
$("stop").addEventListener("pointerdown", () => {
  stopWas = $("stop").className;
  if (!stopWas) stop(); // at once, not at the release
});
$("stop").onclick = () => {
  const was = stopWas ?? $("stop").className;
  if (was === "release" && state) say({ type: "release", robot: state.robot });
  else if (stopWas === null) stop(); // by a key
  stopWas = null;
};

// What the worker says.

worker.onmessage = (event) => {
  const message = event.data;
  if (message.type === "ask") {
    worker.postMessage({ do: "here" });
  } else if (message.type === "welcome") {
    greet(message);
  } else if (message.type === "state") {
    take(message);
  } else if (message.type === "dropped") {
    if (message.press >= hands.press && isHeld) {
      dropped = message.why;
      hands.letGo();
      if (message.why) tell(message.why, true);
    }
  } else if (message.type === "answer") {
    tell(message.text, !message.ok);
  } else if (message.type === "fields") {
    fill($("field"), message.fields, $("field").value);
  } else if (message.type === "lines") {
    drawPlots(message);
  } else if (message.type === "link") {
    link = message.is;
    linkWhy = message.why ?? "";
    draw();
  }
};
worker.postMessage({ do: "open", address: `${own}/drive` });

/** @param {Welcome} message */
function greet(message) {
  welcome = message;
  $("frame").src = `/scene/${message.ticket}/`;
  openPictures(message.ticket);
  fill($("model"), message.models, $("model").value || "hb_bot");
  document.body.classList.toggle("watch", message.look_only);
  document.body.classList.toggle("bag", message.bag !== null);
  $("world").hidden = message.look_only;
  $("bag").hidden = message.bag === null;
  $("time").max = String(message.bag ?? 0);
  for (const one of document.querySelectorAll(".figures, .bars")) /** @type {HTMLElement} */ (one).hidden = message.bag !== null;
}

/** @param {State} message */
function take(message) {
  if (state && state.robot !== message.robot) hands.letGo();
  state = message;
  draw();
}

/** @param {string} text @param {boolean} bad */
function tell(text, bad) {
  if (!text) return;
  $("toast").textContent = text;
  $("toast").className = bad ? "bad" : "";
  $("toast").hidden = false;
  toldUntil = now() + TOLD;
}

// What is shown.

function draw() {
  const sheet = covering();
  $("sheet").hidden = !sheet;
  if (sheet) {
    $("sheet").querySelector("h1").textContent = sheet[0];
    $("sheet").querySelector("p").innerHTML = sheet[1]; // ours alone
  }
  if (state) {
    drawTop(state);
    drawDeck(state);
    drawStage(state);
    drawDrawer(state);
    drawNotice(notice(state));
  }
  const isBlind = byPicture && !isFresh();
  hands.turnOff(Boolean(sheet) || !state || !state.there || Boolean(state.stopped) || isBlind || Boolean(welcome?.look_only));
  document.body.classList.toggle("off", hands.isOff);
}

/** @returns {[string, string] | null} the heading and the line of the sheet that covers all; null: nothing does */
function covering() {
  if (link !== "open") {
    return linkWhy ? [linkWhy, ""] : ["The view does not answer.", "It is tried again until it does. Nothing is driven from here."];
  }
  if (!state) return ["", ""];
  if (welcome?.bag === null && !state.robots.some((one) => one.state !== "silent") && !state.sim) {
    return ["No robot is heard.", "Start one: <code>holozen up</code>"];
  }
  return null;
}

/** @param {State} it @returns {Notice | null} what is, and what to do about it */
function notice(it) {
  if (welcome?.look_only) return null;
  const resume = /** @type {[string, () => void]} */ (["Let the controller drive", () => say({ type: "resume", robot: it.robot })]);
  if (!it.robot) return { text: "The world is empty.", acts: [["Spawn a robot", () => say({ type: "spawn", model: "hb_bot" })]] };
  if (!it.there) {
    const others = it.robots.filter((one) => one.name !== it.robot && one.state !== "silent").slice(0, 3);
    return {
      text: it.robots.some((one) => one.name === it.robot) ? `${it.robot} is silent.` : `${it.robot} is gone.`, bad: true,
      acts: others.map((one) => [`Drive ${one.name}`, () => say({ type: "choose", robot: one.name })]),
    };
  }
  if (it.stopped) return { text: `Stopped by ${it.stopped}, until it is released.`, bad: true };
  if (it.paused) return { text: "The sim is paused.", acts: [["Play", () => say({ type: "simulation", verb: "play" })]] };
  if (it.lost) return { text: "Odometry is lost. Driving blind: go slowly, or stop.", bad: true, acts: [["Slow", () => shift("slow")]] };
  if (it.waiting) return { text: "Waiting for the robot: until it is heard, only stops are sent." };
  if (byPicture && !isFresh()) {
    return { text: "The picture is too old to drive by.", bad: true, acts: [["Drive by the scene", () => driveByPicture(false)]] };
  }
  if (it.limited) return { text: sentence(it.limited), bad: it.limited.startsWith("stopped") };
  if (isHeld && it.refused) return { text: `The robot refuses: ${it.refused}`, bad: true };
  if (it.driver === "page") return { text: "Another page drives this robot. STOP stops it for all." };
  if (it.delay > SLOW) return { text: `The link is slow: ${Math.round(it.delay * 1000)} ms.`, acts: [["Slow", () => shift("slow")]] };
  if (isHeld && !it.strafes && Math.abs(hands.motion()?.y ?? 0) > 0.3) return { text: "This robot cannot go sideways." };
  if (it.held && !it.driver) return { text: "The controller waits until you let it drive.", acts: [resume] };
  return null;
}

/** @param {string} text */
const sentence = (text) => `${text[0].toUpperCase()}${text.slice(1)}.`;

/** @param {Notice | null} one */
function drawNotice(one) {
  const text = JSON.stringify(one && [one.text, one.bad, one.acts?.map(([name]) => name)]);
  if ($("notice").dataset.text === text) return;
  $("notice").dataset.text = text;
  $("notice").hidden = !one;
  if (!one) return;
  $("notice").className = one.bad ? "bad" : "";
  $("notice").querySelector("p").textContent = one.text;
  $("notice").querySelector(".acts").replaceChildren(...(one.acts ?? []).map(([name, act]) => {
    const button = document.createElement("button");
    button.textContent = name;
    button.onclick = act;
    return button;
  }));
}

/** @param {State} it */
function drawTop(it) {
  const key = JSON.stringify([it.robots, it.robot, it.stopped]);
  if ($("robots").dataset.key !== key) {
    $("robots").dataset.key = key;
    const names = it.robots.some((one) => one.name === it.robot) || !it.robot ? it.robots : [...it.robots, { name: it.robot, state: "silent" }];
    const before = new Map([...$("robots").children].map((one) => [one.dataset.robot, one]));
    $("robots").replaceChildren(...names.map((one) => {
      const chip = before.get(one.name) ?? document.createElement("button");
      chip.dataset.robot = one.name;
      if (!chip.firstChild) chip.append(document.createElement("i"), one.name);
      chip.className = one.name === it.robot && it.stopped ? "stopped" : one.state;
      chip.setAttribute("aria-pressed", String(one.name === it.robot));
      chip.onclick = () => say({ type: "choose", robot: one.name });
      return chip;
    }));
    document.title = it.robot ? `${it.robot} – holozen` : "holozen";
  }
  const pill = $("driver");
  const [text, kind] = who(it);
  pill.textContent = text;
  pill.className = `pill ${kind}`;
  pill.title = it.driver_name;
  $("delay").textContent = `${Math.round(it.delay * 1000)} ms`;
  $("delay").parentElement.classList.toggle("slow", it.delay > SLOW);
  $("pace-gauge").hidden = it.pace === null;
  $("pace").textContent = it.pace === null ? "–" : it.pace.toFixed(2);
  $("pace-gauge").classList.toggle("slow", it.pace !== null && it.pace < 0.95);
  $("frames-gauge").hidden = it.frames === null;
  $("frames").textContent = `${it.frames} Hz`;
}

/** @param {State} it @returns {[string, string]} who drives, and the class of that */
function who(it) {
  if (welcome && welcome.bag !== null) return [it.bag && it.bag[1] ? "paused" : "a bag plays", ""];
  if (!it.robot || !it.there) return ["no robot", ""];
  if (it.stopped) return ["stopped", "stopped"];
  const name = it.driver_name.replace(/@.*$/, "");
  switch (it.driver) {
    case "you": return ["you drive", "you"];
    case "page": return ["another page drives", "other"];
    case "": return [it.held ? "the controller waits" : "ready", ""];
    default: return [`${name} drives`, "other"];
  }
}

/** @param {State} it */
function drawDeck(it) {
  const measured = it.measured ?? [0, 0, 0];
  const [top, rate] = GEARS.fast.map((most, index) => Math.min(most, it.limits[index] || most));
  const speed = (/** @type {number[]} */ one) => Math.hypot(one[0], one[1]);
  $("speed").textContent = it.measured ? speed(measured).toFixed(2) : "–";
  $("turning").textContent = it.measured ? (measured[2] < -0.004 ? "−" : measured[2] > 0.004 ? "+" : "") + Math.abs(measured[2]).toFixed(2) : "–";
  $("bar-speed-c").style.width = `${Math.min(100, (100 * speed(it.commanded)) / top)}%`;
  $("bar-speed-m").style.width = `${Math.min(100, (100 * speed(measured)) / top)}%`;
  for (const [id, value] of [["bar-turn-c", it.commanded[2]], ["bar-turn-m", measured[2]]]) {
    const part = Math.max(-1, Math.min(1, Number(value) / rate)) * 50;
    $(id).style.left = `${50 - Math.max(0, part)}%`; // left is counter-clockwise, as the stick is
    $(id).style.width = `${Math.abs(part)}%`;
  }
  if (it.stopped && stoppedAt === null) setTimeout(draw, ALARM); // also if nothing more is heard
  stoppedAt = it.stopped ? (stoppedAt ?? now()) : null;
  const act = stoppedAt !== null && now() >= stoppedAt + ALARM ? "release" : "";
  if ($("stop").className !== act || !$("stop").dataset.drawn) {
    $("stop").dataset.drawn = "1";
    $("stop").className = act;
    $("stop").textContent = act === "release" ? "Release" : "STOP";
  }
  for (const button of $("pacing").children) {
    const [value] = GEARS[/** @type {keyof typeof GEARS} */ (button.dataset.pace)];
    button.title = `${Math.min(value, it.limits[0] || Infinity)} m/s`;
  }
  if (it.bag) {
    if (document.activeElement !== $("time")) $("time").value = String(it.bag[0]);
    $("at").textContent = `${it.bag[0].toFixed(1)} s`;
    $("play").textContent = it.bag[1] ? "Play" : "Pause";
  }
}

/** @param {State} it */
function drawStage(it) {
  const hasPicture = Boolean(it.camera);
  if (!hasPicture && isSwapped) swap();
  $("picture").hidden = !hasPicture;
  $("stage").classList.toggle("both", hasPicture);
  $("stage").classList.toggle("swapped", isSwapped);
  $("camera-name").textContent = it.camera;
  $("scene").className = `view ${isSwapped ? "small" : "large"}`;
  $("picture").className = `view ${isSwapped ? "large" : "small"}`;
  for (const button of $("views").children) button.setAttribute("aria-checked", String(button.dataset.view === it.view));
}

function swap() {
  isSwapped = !isSwapped;
  driveByPicture(isSwapped);
}

/** @param {boolean} on */
function driveByPicture(on) {
  byPicture = on;
  $("by-picture").checked = on;
  draw();
}
for (const button of document.querySelectorAll(".swap")) /** @type {HTMLElement} */ (button).onclick = swap;
$("picture").onclick = (/** @type {Event} */ event) => event.target === $("image") && !isSwapped && swap();
$("by-picture").onchange = () => driveByPicture($("by-picture").checked);
for (const button of $("views").children) button.onclick = () => say({ type: "look", view: button.dataset.view });

// The picture.

const pictures = new Worker("/pictures.js");
pictures.onmessage = ({ data }) => {
  shownPicture = data;
  drawAge();
};

/** @param {string} ticket */
function openPictures(ticket) {
  const address = `${own}/picture/${ticket}`;
  if ($("image").dataset.given) return pictures.postMessage({ address });
  $("image").dataset.given = "1";
  const canvas = $("image").transferControlToOffscreen();
  return pictures.postMessage({ address, canvas }, [canvas]);
}

/** @returns {number} the greatest age of the picture that is shown, in ms: it was sent after the page's time that it names */
const pictureAge = () => (shownPicture ? shownPicture.age * 1000 + now() - shownPicture.sent : Infinity);
const isFresh = () => pictureAge() <= OLD;

function drawAge() {
  const age = pictureAge();
  $("age").textContent = Number.isFinite(age) ? (age < 10000 ? `${Math.round(age)} ms` : "old") : "–";
  const isOld = age > OLD;
  if ($("cover").hidden === isOld) {
    $("cover").hidden = !isOld;
    if (byPicture) draw();
  }
  if (isOld) $("cover").textContent = state?.picture || (shownPicture ? "The picture is old" : "No picture yet");
}

setInterval(() => {
  hands.poll();
  if (state?.camera) drawAge();
  if (!$("toast").hidden && now() > toldUntil) $("toast").hidden = true;
}, POLL);

// Clicks on the ground.

/** @param {string} what @param {string} text */
function beginClick(what, text) {
  clickFor = what;
  if (isSwapped) swap();
  $("click").hidden = false;
  $("click").firstChild.textContent = text;
  if (innerWidth < 720) openDrawer(false);
}
function endClick() {
  clickFor = "";
  $("click").hidden = true;
}
$("click").addEventListener("click", (/** @type {MouseEvent} */ event) => {
  const box = $("frame").getBoundingClientRect();
  const [u, v] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  if (state) say({ type: "goal", robot: state.robot, u, v, place: clickFor === "place" });
  endClick();
});
$("goal").onclick = () => beginClick("goal", "Click where it is to go");
$("place").onclick = () => beginClick("place", "Click where to put it");

// The drawer.

/** @param {boolean} open */
function openDrawer(open) {
  $("drawer").hidden = !open;
  document.body.classList.toggle("drawn", open);
  $("menu").setAttribute("aria-expanded", String(open));
}
$("menu").onclick = () => openDrawer($("drawer").hidden);
for (const button of document.querySelectorAll("#simulation button")) {
  /** @type {HTMLElement} */ (button).onclick = () => say({ type: "simulation", verb: /** @type {HTMLElement} */ (button).dataset.verb });
}
$("spawn").onclick = () => say({ type: "spawn", model: $("model").value });
$("delete").onclick = () => {
  const button = $("delete");
  if (button.classList.contains("sure")) {
    say({ type: "delete", robot: button.dataset.robot });
    calm();
  } else if (state) {
    button.dataset.robot = state.robot;
    button.classList.add("sure");
    button.textContent = `Really delete ${state.robot}?`;
    setTimeout(calm, ASKED);
  }
};
function calm() {
  $("delete").classList.remove("sure");
  $("delete").textContent = "Delete the robot";
}
$("slows").onchange = () => {
  $("slows").dataset.at = String(now());
  if (state) say({ type: "slow_down", robot: state.robot, on: $("slows").checked });
};
$("camera").onchange = () => say({ type: "camera", key: $("camera").value });
$("fixed").onchange = () => say({ type: "frame", name: $("fixed").value });
$("topic").onchange = () => {
  fill($("field"), [], "");
  say({ type: "fields", key: $("topic").value });
};
$("plot").onclick = () => $("field").value && say({ type: "plot", key: $("topic").value, field: $("field").value, on: true });
$("play").onclick = () => say({ type: "play" });
$("time").oninput = () => say({ type: "play", at: Number($("time").value) });

/** Fill a choice, if it has changed. @param {any} select @param {string[]} options @param {string} value */
function fill(select, options, value) {
  const key = JSON.stringify(options);
  if (select.dataset.key !== key) {
    select.dataset.key = key;
    select.replaceChildren(...options.map((one) => new Option(one || "(none)", one)));
  }
  if (select.value !== value && options.includes(value)) select.value = value;
}

/** Check a box, unless the state may be from before a click on it. @param {any} box @param {boolean} on */
function settle(box, on) {
  if (now() - Number(box.dataset.at ?? 0) > SETTLES) box.checked = on;
}

/** @param {State} it */
function drawDrawer(it) {
  if ($("drawer").hidden) return;
  $("camera-section").hidden = !it.cameras.length;
  if (document.activeElement !== $("camera")) fill($("camera"), ["", ...it.cameras], it.camera);
  if (document.activeElement !== $("fixed")) fill($("fixed"), it.frames_of, it.frame);
  if (document.activeElement !== $("topic")) fill($("topic"), ["", ...it.topics], $("topic").value);
  const key = JSON.stringify(it.boxes.map((one) => one.label));
  if ($("boxes").dataset.key !== key) {
    $("boxes").dataset.key = key;
    $("boxes").replaceChildren(...it.boxes.map((one) => {
      const label = document.createElement("label");
      label.className = "check";
      const box = document.createElement("input");
      box.type = "checkbox";
      box.onchange = () => {
        box.dataset.at = String(now());
        say({ type: "display", label: one.label, on: box.checked });
      };
      label.append(box, one.label);
      return label;
    }));
  }
  it.boxes.forEach((one, index) => settle($("boxes").children[index].firstChild, one.on));
  $("slows-row").hidden = it.slows === null;
  settle($("slows"), Boolean(it.slows));
  const problems = it.problems.join("\n");
  if ($("problems").dataset.text !== problems) {
    $("problems").dataset.text = problems;
    $("problems").replaceChildren(...it.problems.map((one) => Object.assign(document.createElement("li"), { textContent: one })));
  }
}

/** @type {Map<string, HTMLElement>} the plots, by topic and field */
const plots = new Map();

/** @param {{now: number, lines: {key: string, field: string, points: [number, number][]}[]}} all */
function drawPlots(all) {
  if ($("hold-plots").checked || $("drawer").hidden) return;
  for (const line of all.lines) {
    const name = `${line.key} ${line.field}`;
    const place = plots.get(name) ?? addPlot(name, line.key, line.field);
    drawPlot(/** @type {HTMLCanvasElement} */ (place.querySelector("canvas")), line.points, all.now);
  }
}

/** @param {string} name @param {string} key @param {string} field */
function addPlot(name, key, field) {
  const place = document.createElement("div");
  place.className = "plot";
  const remove = Object.assign(document.createElement("button"), { textContent: "Remove" });
  remove.onclick = () => {
    say({ type: "plot", key, field, on: false });
    plots.delete(name);
    place.remove();
  };
  const head = document.createElement("header");
  head.append(Object.assign(document.createElement("span"), { textContent: name, title: name }), remove);
  place.append(head, document.createElement("canvas"));
  $("plots").append(place);
  plots.set(name, place);
  return place;
}

/** @param {HTMLCanvasElement} canvas @param {[number, number][]} points @param {number} end in s */
function drawPlot(canvas, points, end) {
  const ratio = devicePixelRatio;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  canvas.width = width * ratio;
  canvas.height = height * ratio;
  canvas.dataset.points = String(points.length);
  const pen = canvas.getContext("2d");
  if (!pen || points.length < TOO_FEW) return;
  pen.scale(ratio, ratio);
  const values = points.map(([, value]) => value);
  let [low, high] = [Math.min(...values), Math.max(...values)];
  if (high - low < 1e-9) [low, high] = [low - 0.5, high + 0.5];
  const [left, span] = [52, 20];
  const x = (/** @type {number} */ at) => left + ((at - end + span) / span) * (width - left - 6);
  const y = (/** @type {number} */ value) => 8 + ((high - value) / (high - low)) * (height - 16);
  pen.fillStyle = "#93a1b2";
  pen.font = "11px system-ui";
  pen.textAlign = "right";
  pen.fillText(high.toPrecision(3), left - 6, 12);
  pen.fillText(low.toPrecision(3), left - 6, height - 5);
  pen.strokeStyle = "#3b8bff";
  pen.lineWidth = 1.6;
  pen.beginPath();
  points.forEach(([at, value], index) => (index ? pen.lineTo(x(at), y(value)) : pen.moveTo(x(at), y(value))));
  pen.stroke();
}

shift("normal");
draw();
