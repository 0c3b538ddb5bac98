"""The protocol between `work_precision` and a peer's process: JSON, one line per request and one per answer.

It uses the standard library only, since every peer has its own environment. A request has the problem (see
`problems.py`), the configuration, the number of warm-up runs and the number of samples. An answer has the processor
time (s) of every sample and the displacement of the tip at every load factor, (n, 3) m; or the error.
"""

import json
import os
import platform
import sys
import time


class Stopped(Exception):
    """The peer's solver did not reach every load factor; the message gives the reason."""


def serve(prepare, versions):
    """Answer requests until the input ends; versions: names and versions, for the record.

    prepare(problem, configuration) builds the model once, outside of every sample, and returns solve(), which goes from
    the unloaded state over all load factors and returns the tip's displacements, or (tip, seconds) with a processor
    time of its own if not all of it is to be counted.
    """
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # other output of a peer goes to stderr
    kept = {}
    for line in sys.stdin:
        request = json.loads(line)
        key = json.dumps([request["problem"], request["configuration"]], sort_keys=True)
        try:
            if key not in kept:
                while len(kept) >= 8:
                    kept.pop(next(iter(kept)))
                kept[key] = prepare(request["problem"], request["configuration"])
            reply = _measure(kept[key], request.get("warm", 1), request.get("samples", 1))
        except Exception as error:  # noqa: BLE001  whatever a peer raises is an answer too
            kept.pop(key, None)
            reply = {"failed": f"{type(error).__name__}: {error}"[:300]}
        reply["versions"] = {"python": platform.python_version(), **versions}
        print(json.dumps(reply), file=out, flush=True)


def _measure(solve, warm, samples):
    for _ in range(warm):
        solve()
    seconds = []
    for _ in range(samples):
        began = time.process_time()
        tip = solve()
        spent = time.process_time() - began
        if isinstance(tip, tuple):
            tip, spent = tip
        seconds.append(spent)
    return {"seconds": seconds, "tip": [[float(x) for x in row] for row in tip]}
