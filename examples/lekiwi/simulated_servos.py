"""Three simulated STS3215 servos: prints their port, then their speeds in steps/s whenever these
change. Run it by `python examples/lekiwi/simulated_servos.py`.
"""

import os
import pty
import tty

from feetech import ALL, GOAL_SPEED, READ, SPEED, STEPS, SYNC_WRITE, WRITE, packet, rate_of

IDS = (7, 8, 9)


class Simulated:
    """Servos that reach a commanded speed at once."""

    def __init__(self) -> None:
        self.registers = {servo: bytearray(128) for servo in IDS}

    def answer(self, servo: int, instruction: int, parameters: bytes) -> bytes:
        """Process an instruction. Returns the answer, empty if there is none."""
        if instruction == SYNC_WRITE:
            address, length, *values = parameters
            for start in range(0, len(values), length + 1):
                self._write(values[start], address, bytes(values[start + 1 : start + 1 + length]))
        if servo == ALL or servo not in self.registers:
            return b""
        if instruction == WRITE:
            self._write(servo, parameters[0], parameters[1:])
            return packet(servo, 0)
        if instruction == READ:
            address, length = parameters
            return packet(servo, 0, bytes(self.registers[servo][address : address + length]))
        return b""

    def _write(self, servo: int, address: int, value: bytes) -> None:
        if servo in self.registers:
            self.registers[servo][address : address + len(value)] = value
            if address == GOAL_SPEED:
                self.registers[servo][SPEED : SPEED + 2] = value

    def speeds(self) -> str:
        """The speeds of all servos, in steps/s."""
        steps = {
            servo: round(rate_of(bytes(each[SPEED : SPEED + 2])) * STEPS)
            for servo, each in self.registers.items()
        }
        return " ".join(f"{servo}:{speed}" for servo, speed in steps.items())


def packets(data: bytearray) -> "list[tuple[int, int, bytes]]":
    """Remove the whole packets from the start of the received bytes, and return them."""
    found = []
    while len(data) >= 6:
        if data[:2] != b"\xff\xff":
            del data[0]
        elif len(data) < 4 + data[3]:
            break
        else:
            servo, length, instruction = data[2], data[3], data[4]
            parameters = bytes(data[5 : 3 + length])
            if bytes(data[: 4 + length]) == packet(servo, instruction, parameters):
                found.append((servo, instruction, parameters))
            del data[: 4 + length]
    return found


def main() -> None:
    here, there = pty.openpty()
    tty.setraw(there)
    servos, received, shown = Simulated(), bytearray(), ""
    print(os.ttyname(there), flush=True)
    while True:
        received += os.read(here, 1024)
        for servo, instruction, parameters in packets(received):
            os.write(here, servos.answer(servo, instruction, parameters))
        if (speeds := servos.speeds()) != shown:
            print(speeds, flush=True)
            shown = speeds


if __name__ == "__main__":
    main()
