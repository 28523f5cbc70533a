"""What Zenoh says of its failures, in words for people."""


def opening(error: Exception, mode: str, where: str, patience: float | None) -> str:
    """Why a session could not be opened that looks for others at `where`."""
    text = reason(error)
    if mode == "client" and text.startswith(("Unable to connect", "No peer")):
        if not where:
            return "cannot open Zenoh: a client needs --connect ENDPOINT, such as tcp/10.0.0.2:7447"
        within = f" within {patience:g} s" if patience else ""
        return f"cannot open Zenoh: no router answers at {where}{within}; `holozen router` runs one"
    if text.startswith("Can not create a new TCP listener bound to "):
        endpoint, _, why = text.removeprefix("Can not create a new TCP listener bound to ").partition(": ")
        return f"cannot open Zenoh: cannot listen at {endpoint}: {_system(why)}"
    return f"cannot open Zenoh: {text}"


def reason(error: Exception) -> str:
    """Zenoh's reason in one line, without the source files it comes from."""
    text = " ".join(str(error).partition(" at /")[0].replace("\\n", " ").split()).rstrip(".")
    if text == 'Str("unknown key")':
        return "there is no such setting"
    if text.startswith("Json5Err(Message { msg: "):
        text = text.removeprefix("Json5Err(Message { msg: ").partition(", location: ")[0].strip('" ')
    return text.strip()


def _system(why: str) -> str:
    """The system's words among Zenoh's: `[10.0.0.1:7: Cannot assign requested address (os error 99)`."""
    return why.strip("[]").rpartition(": ")[2].partition(" (os error")[0] or why
