// @ts-check
/**
 * The beat of the page, in a thread of its own, so that a page that is busy drawing does not end a hold by mistake.
 *
 * It owns the socket from which the page drives. As long as the page itself answers, it reports what is held 20 times a
 * second; once the page has not answered for HANG, it lets go. The server stops the robot when nothing is reported.
 */

/**
 * What is held, see protocol.py.
 * @typedef {{press: number, robot: string, x: number, y: number, turn: number, speed: number, rate: number}} Hold
 */

const PROTOCOL = "holozen.cockpit.1";
const PERIOD = 50; // ms between two reports
const HANG = 380; // ms without an answer of the page after which it counts as hung
const SILENT = 500; // ms without a beat of the server after which nothing can be held
const DEAD = 2500; // ms without a beat after which the socket is given up
const AGAIN = 500; // ms before the next try

/** @type {WebSocket | null} */
let socket = null;
let address = "";
/** @type {Hold | null} */
let held = null;
let echo = 0;
let answeredAt = 0;
let beatAt = 0;
let isSilent = true;

/** The time by the page's clock in ms, the same in all its threads. */
const now = () => performance.timeOrigin + performance.now();

/** @param {object} message to the server, which gets the echo of its last beat */
function say(message) {
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({ ...message, echo }));
}

/** @param {string} why what is held counts as let go */
function drop(why) {
  if (!held) return;
  say({ type: "let_go", press: held.press });
  postMessage({ type: "dropped", press: held.press, why });
  held = null;
}

function report() {
  say(held ? { type: "hold", ...held, sent: now() } : { type: "ping", sent: now() });
}

function open() {
  const made = new WebSocket(address, PROTOCOL);
  socket = made;
  echo = 0;
  beatAt = now();
  made.onmessage = (event) => {
    const message = JSON.parse(event.data);
    if (message.type === "beat") {
      echo = message.echo;
      beatAt = now();
      if (isSilent) {
        isSilent = false;
        postMessage({ type: "link", is: "open" });
      }
    } else {
      postMessage(message);
    }
  };
  made.onclose = (event) => {
    if (socket !== made) return;
    socket = null;
    isSilent = true;
    drop("the link to the view was lost; press again");
    postMessage({ type: "link", is: "closed", why: event.reason });
    setTimeout(open, AGAIN);
  };
}

function tick() {
  const time = now();
  postMessage({ type: "ask" });
  if (time - answeredAt > HANG) drop("the page hung; press again");
  if (!isSilent && time - beatAt > SILENT) {
    isSilent = true;
    drop("the view does not answer; press again");
    postMessage({ type: "link", is: "silent" });
  }
  if (socket && time - beatAt > DEAD) {
    const dead = socket;
    dead.close(); // its own `onclose` may come only after the network's patience
    dead.onclose?.(new CloseEvent("close"));
  }
  report();
}

onmessage = (event) => {
  const message = event.data;
  answeredAt = now();
  if (message.do === "open") {
    address = message.address;
    open();
    setInterval(tick, PERIOD);
  } else if (message.do === "hold") {
    if (isSilent) {
      postMessage({ type: "dropped", press: message.hold.press, why: "the view does not answer" });
      return;
    }
    held = message.hold;
    report();
  } else if (message.do === "let_go") {
    held = null;
    say({ type: "let_go", press: message.press });
  } else if (message.do === "say") {
    say(message.message);
  }
};
