"""A headless Chromium, driven by its DevTools protocol over a pipe: real mouse, touch and keyboard events."""

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile

PROGRAM = next((found for found in map(shutil.which, ("chromium", "chromium-browser", "google-chrome")) if found), None)
_FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--remote-debugging-pipe", "--no-first-run", "--disable-extensions", "--disable-background-networking",
    "--disable-dev-shm-usage", "--host-resolver-rules=MAP * ~NOTFOUND", "--hide-scrollbars",
)  # fmt: skip


class Page:
    """A page of a file, as a context manager; `errors` holds exceptions, errors and requests other than the file."""

    def __init__(self, file, size=(900, 600)):
        self.errors, self._number, self._rest = [], 0, b""
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        theirs, self._to = os.pipe()
        self._from, answers = os.pipe()
        script = f'exec "$@" 3<&{theirs} 4>&{answers}'
        command = [
            PROGRAM,
            *_FLAGS,
            f"--user-data-dir={self._folder.name}",
            f"--window-size={size[0]},{size[1]}",
            "about:blank",
        ]
        self._process = subprocess.Popen(
            ["bash", "-c", script, "bash", *command], pass_fds=(theirs, answers), stderr=subprocess.DEVNULL
        )
        os.close(theirs)
        os.close(answers)
        self._session = None
        target = next(x for x in self.send("Target.getTargets")["targetInfos"] if x["type"] == "page")
        self._session = self.send("Target.attachToTarget", targetId=target["targetId"], flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.send(f"{domain}.enable")
        self.resize(*size)
        self.open(file)

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self._session = None
        self.send("Browser.close")
        self._process.wait(timeout=20)
        os.close(self._to)
        os.close(self._from)
        self._folder.cleanup()

    def open(self, file):
        """Load the page of a file."""
        self._file, self._loaded = f"file://{file}", False
        self.send("Page.navigate", url=self._file)
        while not self._loaded:
            self._read()
        self.frame()

    def resize(self, width, height):
        """Give the page another size, pixels."""
        self.send("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def send(self, method, **params):
        """The result of a command."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": params}
        os.write(
            self._to, json.dumps({**message, "sessionId": self._session} if self._session else message).encode() + b"\0"
        )
        while True:
            answer = self._read()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]

    def _read(self):
        while b"\0" not in self._rest:
            assert select.select([self._from], [], [], 60)[0], "Chromium has not answered for a minute"
            more = os.read(self._from, 1 << 20)
            assert more, "Chromium ended"
            self._rest += more
        text, self._rest = self._rest.split(b"\0", 1)
        message = json.loads(text)
        method, params = message.get("method"), message.get("params", {})
        if method == "Page.loadEventFired":
            self._loaded = True
        if method == "Runtime.exceptionThrown" or (method == "Log.entryAdded" and params["entry"]["level"] == "error"):
            self.errors.append(json.dumps(params))
        if method == "Network.requestWillBeSent" and params["request"]["url"] != self._file:
            self.errors.append(params["request"]["url"])
        return message

    def value(self, expression):
        """The value of an expression of JavaScript, after promises."""
        result = self.send("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def frame(self):
        """Wait until what has changed is drawn."""
        self.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def middle(self, selector):
        """(x, y) of the middle of an element, pixels."""
        return self.value(
            f"(() => {{ const r = document.querySelector({selector!r}).getBoundingClientRect();"
            "return [r.x + r.width / 2, r.y + r.height / 2] })()"
        )

    def drag(self, x, y, dx, dy, *, steps=5, button="left", shift=False):
        """Drag the mouse from (x, y) by (dx, dy), pixels."""
        more = {"button": button, "modifiers": 8 * shift, "clickCount": 1}
        self.send("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, **more)
        for i in range(1, steps + 1):
            place = {"x": x + dx * i / steps, "y": y + dy * i / steps}
            self.send(
                "Input.dispatchMouseEvent", type="mouseMoved", buttons=2 if button == "right" else 1, **place, **more
            )
        self.send("Input.dispatchMouseEvent", type="mouseReleased", x=x + dx, y=y + dy, **more)
        self.frame()

    def click(self, selector):
        """Click the middle of an element."""
        self.drag(*self.middle(selector), 0, 0, steps=1)

    def wheel(self, x, y, delta):
        """Turn the mouse wheel."""
        self.send("Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=delta)
        self.frame()

    def touch(self, *tracks):
        """Move fingers along straight lines: ((x, y), (x, y)) each, pixels."""
        for i in range(6):
            points = [{"x": a[0] + (b[0] - a[0]) * i / 5, "y": a[1] + (b[1] - a[1]) * i / 5, "id": k}
                      for k, (a, b) in enumerate(tracks)]  # fmt: skip
            self.send("Input.dispatchTouchEvent", type="touchMove" if i else "touchStart", touchPoints=points)
        self.send("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
        self.frame()

    def key(self, key, code):
        """Press and release a key."""
        for kind in ("rawKeyDown", "keyUp"):
            self.send(
                "Input.dispatchKeyEvent",
                type=kind,
                key=key,
                code=key if len(key) > 1 else "Space",
                windowsVirtualKeyCode=code,
            )
        self.frame()

    def screenshot(self):
        """The bytes of a .png of the page."""
        return base64.b64decode(self.send("Page.captureScreenshot", format="png")["data"])
