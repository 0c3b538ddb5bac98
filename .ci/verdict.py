"""What the outcome on one of Debian's suites means for the whole run."""

import re

#: Suites that change from day to day, and the release of dolfinx there on which everything is recorded to pass.
DEVELOPMENT = {"sid": "0.11.0"}


def release(version):
    """The release a version belongs to: 0.11.0 for 0.11.0.post0."""
    return re.match(r"\d+(\.\d+)*", version)[0]


def verdict(suite, version, failure):
    """(what to say, exit code).

    Args:
        version: dolfinx's in the tree; None where there is no tree, or none that is complete.
        failure: what failed, in words; None where everything passed.
    """
    recorded = DEVELOPMENT.get(suite)
    on = f"debian:{suite}" + (f", dolfinx {version}" if version else "")
    if failure and not recorded:
        return f"FAILED on {on}: {failure}", 1
    if failure and not version:
        return f"SKIPPED: {on} cannot be had today: {failure}", 0
    if failure and release(version) == recorded:
        return f"FAILED on {on}, which is recorded as passing: {failure}", 1
    if failure:
        return f"WARNING: failed on {on}; only {recorded} is recorded as passing, so the run goes on: {failure}", 0
    if recorded and release(version) != recorded:
        return f"passed on {on}; recorded is {recorded}: please update DEVELOPMENT in .ci/verdict.py", 0
    return f"passed on {on}", 0
