"""An invalid endpoint is refused before Zenoh sees it."""

from holozen.transport.connection import fault


def test_a_good_endpoint_has_no_fault() -> None:
    for text in [
        "tcp/127.0.0.1:7447",
        "tcp/localhost:0",
        "tcp/[::1]:7447",
        "udp/10.0.0.2:7447",
        "tls/robot.local:7447",
        "tcp/127.0.0.1:7447#iface=lo",
        "tcp/127.0.0.1:7447?prio=1-3",
        "unixsock-stream//tmp/socket",
        "serial//dev/ttyUSB0#baudrate=9600",
    ]:
        assert fault(text) == ""


def test_a_fault_is_reported_with_the_right_spelling() -> None:
    for text, expected in [
        (
            "127.0.0.1:7447",
            "'127.0.0.1:7447' is not an endpoint: write PROTOCOL/HOST:PORT, such as "
            "tcp/10.0.0.2:7447",
        ),
        ("", "'' is not an endpoint"),
        ("tcp/", "'tcp/' is not an endpoint"),
        ("tcp/a b:1", "'tcp/a b:1' is not an endpoint"),
        ("tcp/\n:1", "'tcp/\\n:1' is not an endpoint"),
        ("tpc/h:1", "'tpc/h:1': no protocol 'tpc' (did you mean 'tcp'?); there are tcp, udp, "),
        ("pigeon/h:1", "'pigeon/h:1': no protocol 'pigeon'; there are tcp, "),
        ("tcp/localhost", "'tcp/localhost' has no port from 0 to 65535: write "),
        ("tcp/:7447", "'tcp/:7447' has no port"),
        ("tcp/h:99999", "'tcp/h:99999' has no port"),
        ("tcp/h:x", "'tcp/h:x' has no port"),
    ]:
        assert fault(text).startswith(expected)
