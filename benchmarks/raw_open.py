"""The least that a verb can do: raw zenoh that opens, links and closes. The endpoint is its argument."""

import sys
import time

import zenoh

config = zenoh.Config()
config.insert_json5("scouting/multicast/enabled", "false")
config.insert_json5("scouting/delay", "0")
config.insert_json5("connect/endpoints", f'["{sys.argv[1]}"]')
config.insert_json5("listen/endpoints", '["tcp/127.0.0.1:0"]')
with zenoh.open(config) as session:
    while not session.info.peers_zid():
        time.sleep(0.001)
    print("up", flush=True)
