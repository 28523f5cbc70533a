"""The least that a verb can do, in raw zenoh: `open ENDPOINT` opens, links and closes; `echo
ENDPOINT` waits for the first sample of odom.
"""

import sys
import time

import zenoh

verb, endpoint = sys.argv[1:]
config = zenoh.Config()
config.insert_json5("scouting/multicast/enabled", "false")
config.insert_json5("scouting/delay", "0")
config.insert_json5("connect/endpoints", f'["{endpoint}"]')
config.insert_json5("listen/endpoints", '["tcp/127.0.0.1:0"]')
with zenoh.open(config) as session:
    if verb == "echo":
        print(session.declare_subscriber("odom").recv().payload.to_string(), flush=True)
    else:
        while not session.info.peers_zid():
            time.sleep(0.001)
        print("up", flush=True)
