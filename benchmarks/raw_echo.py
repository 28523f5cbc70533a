"""The least that echoes: raw zenoh, the first sample of odom at the endpoint named on the command line."""

import sys

import zenoh

config = zenoh.Config()
config.insert_json5("scouting/multicast/enabled", "false")
config.insert_json5("scouting/delay", "0")
config.insert_json5("connect/endpoints", f'["{sys.argv[1]}"]')
config.insert_json5("listen/endpoints", '["tcp/127.0.0.1:0"]')
with zenoh.open(config) as session:
    print(session.declare_subscriber("odom").recv().payload.to_string(), flush=True)
