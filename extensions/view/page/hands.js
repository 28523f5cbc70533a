// @ts-check
/**
 * What a person's hands hold: keys, sticks, a gamepad -> one motion.
 *
 * A press begins when anything is held after nothing was. Whatever ends it for another reason than the person's own
 * release (another window, a lost finger, the server's word) spends all that is held: it has to be let go, and pressed
 * again.
 */

/** @typedef {{x: number, y: number, turn: number}} Motion parts of the chosen speeds, from -1 to 1 */

/** @type {Record<string, Motion>} what keys do, by what they type */
export const KEYS = {
  w: { x: 1, y: 0, turn: 0 }, s: { x: -1, y: 0, turn: 0 },
  a: { x: 0, y: 1, turn: 0 }, d: { x: 0, y: -1, turn: 0 },
  q: { x: 0, y: 0, turn: 1 }, e: { x: 0, y: 0, turn: -1 },
  i: { x: 1, y: 0, turn: 0 }, ",": { x: -1, y: 0, turn: 0 },
  j: { x: 0, y: 0, turn: 1 }, l: { x: 0, y: 0, turn: -1 },
  J: { x: 0, y: 1, turn: 0 }, L: { x: 0, y: -1, turn: 0 },
  u: { x: 1, y: 0, turn: 1 }, o: { x: 1, y: 0, turn: -1 },
  m: { x: -1, y: 0, turn: -1 }, ".": { x: -1, y: 0, turn: 1 },
  ArrowUp: { x: 1, y: 0, turn: 0 }, ArrowDown: { x: -1, y: 0, turn: 0 },
  ArrowLeft: { x: 0, y: 0, turn: 1 }, ArrowRight: { x: 0, y: 0, turn: -1 },
};
const REST = 0.12; // of a gamepad's way, which counts as none
const STOPS = [1, 9]; // a gamepad's buttons that stop: B and Start

export class Hands {
  /**
   * @param {(motion: Motion | null, press: number) => void} changed
   * @param {() => void} stopped by a button of a gamepad
   */
  constructor(changed, stopped) {
    this.changed = changed;
    this.stopped = stopped;
    this.press = 0;
    /** @type {Map<string, string>} the keys that are down, by code: what they typed; "" once they are spent */
    this.keys = new Map();
    /** @type {Map<number, {stick: string, at: Motion}>} what pointers hold */
    this.pointers = new Map();
    /** @type {Motion | null} */
    this.gamepad = null;
    this.gamepadSpent = false;
    this.gamepadStops = false;
    this.isOff = false;
    /** @type {Motion | null} */
    this.last = null;
  }

  /** @returns {Motion | null} all that is held, together */
  motion() {
    const held = [...this.pointers.values()].map((one) => one.at);
    for (const typed of this.keys.values()) if (typed) held.push(KEYS[typed]);
    if (this.gamepad) held.push(this.gamepad);
    if (!held.length || this.isOff) return null;
    const sum = { x: 0, y: 0, turn: 0 };
    for (const one of held) {
      sum.x += one.x;
      sum.y += one.y;
      sum.turn += one.turn;
    }
    const length = Math.max(1, Math.hypot(sum.x, sum.y));
    return { x: sum.x / length, y: sum.y / length, turn: Math.max(-1, Math.min(1, sum.turn)) };
  }

  update() {
    const motion = this.motion();
    if (motion && !this.last) this.press += 1;
    this.last = motion;
    this.changed(motion, this.press);
  }

  /** Spend all that is held. */
  letGo() {
    for (const code of this.keys.keys()) this.keys.set(code, "");
    this.pointers.clear();
    if (this.gamepad) this.gamepadSpent = true;
    this.gamepad = null;
    this.update();
  }

  /** @param {boolean} off nothing counts as long as it is */
  turnOff(off) {
    if (off === this.isOff) return;
    this.isOff = off;
    if (off) this.letGo();
  }

  /** @param {KeyboardEvent} event @returns {boolean} whether it was a key that drives */
  keyDown(event) {
    if (event.key === "Meta" || event.metaKey || event.ctrlKey || event.altKey) {
      // Command swallows the releases of other keys; the others begin what the browser does.
      this.letGo();
      return false;
    }
    const typed = KEYS[event.key] ? event.key : KEYS[event.key.toLowerCase()] ? event.key.toLowerCase() : "";
    if (!typed) return false;
    if (!event.repeat && !this.keys.has(event.code)) {
      this.keys.set(event.code, this.isOff ? "" : typed);
      this.update();
    }
    return true;
  }

  /** @param {KeyboardEvent} event */
  keyUp(event) {
    if (event.key === "Meta") this.letGo();
    if (this.keys.delete(event.code)) this.update();
  }

  /** Forget the keys: their releases go elsewhere. */
  away() {
    this.letGo();
    this.keys.clear();
  }

  /** @param {number} pointer @param {string} stick @param {Motion} at */
  hold(pointer, stick, at) {
    if (this.isOff) return;
    this.pointers.set(pointer, { stick, at });
    this.update();
  }

  /** @param {number} pointer @param {string} stick the one that it moves over, which may lie in the one it holds @param {Motion} at */
  move(pointer, stick, at) {
    const held = this.pointers.get(pointer);
    if (held?.stick !== stick) return;
    held.at = at;
    this.update();
  }

  /** @param {number} pointer that its person has lifted */
  lift(pointer) {
    if (this.pointers.delete(pointer)) this.update();
  }

  /** @param {number} pointer that the browser took away: nobody knows what the others still mean */
  lose(pointer) {
    if (this.pointers.has(pointer)) this.letGo();
  }

  /** Read the gamepads. */
  poll() {
    const pad = [...navigator.getGamepads()].find((one) => one && one.connected);
    const rest = (/** @type {number | undefined} */ value) => (Math.abs(value ?? 0) < REST ? 0 : -(value ?? 0));
    const at = pad ? { x: rest(pad.axes[1]), y: rest(pad.axes[0]), turn: rest(pad.axes[2]) } : null;
    const isMoved = at !== null && (at.x !== 0 || at.y !== 0 || at.turn !== 0);
    const stops = STOPS.some((button) => pad?.buttons[button]?.pressed);
    if (stops && !this.gamepadStops) this.stopped();
    this.gamepadStops = stops;
    if (!isMoved) this.gamepadSpent = false;
    const held = isMoved && !this.gamepadSpent && !this.isOff ? at : null;
    if (isMoved && this.isOff) this.gamepadSpent = true;
    if (JSON.stringify(held) !== JSON.stringify(this.gamepad)) {
      this.gamepad = held;
      this.update();
    }
  }
}

/**
 * A stick under a pointer: a round one that translates, a ring that turns, or a thumb's that turns.
 * @param {HTMLElement} place
 * @param {"move" | "ring" | "turn"} kind
 * @param {Hands} hands
 */
export function stick(place, kind, hands) {
  let began = 0;
  /** @param {PointerEvent} event @returns {Motion} */
  const at = (event) => {
    const box = place.getBoundingClientRect();
    const radius = box.width / 2;
    const right = (event.clientX - box.left - radius) / radius;
    const down = (event.clientY - box.top - radius) / radius;
    if (kind === "ring") {
      const turned = Math.atan2(Math.sin(angle(right, down) - began), Math.cos(angle(right, down) - began));
      return { x: 0, y: 0, turn: limited(turned / 0.9) };
    }
    if (kind === "turn") return { x: 0, y: 0, turn: limited(-right / 0.75) };
    const far = Math.max(1, Math.hypot(right, down) / 0.75) * 0.75;
    return { x: dead(-down / far), y: dead(-right / far), turn: 0 };
  };
  place.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    event.preventDefault();
    event.stopPropagation();
    const box = place.getBoundingClientRect();
    began = angle(event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2);
    place.setPointerCapture(event.pointerId);
    hands.hold(event.pointerId, kind, at(event));
  });
  place.addEventListener("pointermove", (event) => hands.move(event.pointerId, kind, at(event)));
  place.addEventListener("pointerup", (event) => hands.lift(event.pointerId));
  place.addEventListener("pointercancel", (event) => hands.lose(event.pointerId));
  place.addEventListener("lostpointercapture", (event) => hands.lose(event.pointerId));
  place.addEventListener("contextmenu", (event) => event.preventDefault());
}

/** @param {number} right @param {number} down @returns {number} counter-clockwise, in rad */
const angle = (right, down) => Math.atan2(-down, right);
/** @param {number} value */
const limited = (value) => Math.max(-1, Math.min(1, value));
/** @param {number} value a small push is none, so that one goes straight */
const dead = (value) => (Math.abs(value) < 0.08 ? 0 : limited(value));
