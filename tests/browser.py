"""Chromium, and a page of `Comparison.report` that is open in it."""

import shutil

from selenium import webdriver
from selenium.webdriver import ActionChains, Keys
from selenium.webdriver.common.actions.wheel_input import ScrollOrigin

__all__ = ["Keys", "Page", "chromium"]

FLAGS = (
    "headless=new",
    "no-sandbox",  # which root cannot have
    "disable-gpu",
    "disable-quic",
    "no-first-run",
    "disable-background-networking",
    "disable-component-update",
    "disable-sync",
    "force-device-scale-factor=1",
    "window-size=1280,900",
)


def chromium(profile):
    """A driver.

    Args:
        profile: an empty folder.
    """
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for flag in (*FLAGS, f"user-data-dir={profile}"):
        options.add_argument(f"--{flag}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options, webdriver.ChromeService(shutil.which("chromedriver")))
    driver.set_script_timeout(20)
    return driver


class Page:
    """A page that is open, and what may be done with it."""

    def __init__(self, driver, path):
        self.driver = driver
        driver.get(path.as_uri())
        self.settle()

    def run(self, script, *arguments):
        return self.driver.execute_script(script, *arguments)

    def settle(self):
        """Waits until all that was asked for is shown."""
        self.driver.execute_async_script(
            "const done = arguments[0], main = document.querySelector('main');"
            "const look = () => main.getAttribute('aria-busy') === 'false' ? done() : setTimeout(look, 5);"
            "setTimeout(look, 20);"
        )

    def get(self, selector):
        return self.driver.find_element("css selector", selector)

    def click(self, selector):
        element = self.get(selector)
        self.run("arguments[0].scrollIntoView({block: 'center'})", element)
        element.click()
        self.settle()

    def keys(self, selector, *keys):
        self.get(selector).send_keys(*keys)
        self.settle()

    def choose(self, id, name):
        self.run(
            "const select = document.getElementById(arguments[0]); select.value = arguments[1];"
            "select.dispatchEvent(new Event('change'))",
            id,
            name,
        )
        self.settle()

    def pointer(self, x, y):
        """Actions that begin at (x, y) of the canvas, in pixels of the image."""
        canvas = self.get("#canvas")
        self.run("arguments[0].scrollIntoView({block: 'center'})", canvas)
        return ActionChains(self.driver, duration=0).move_to_element_with_offset(canvas, *self.offset(x, y))

    def wheel(self, x, y, delta):
        """Turns the wheel at (x, y), as `pointer` has it."""
        canvas = self.get("#canvas")
        self.run("arguments[0].scrollIntoView({block: 'center'})", canvas)
        origin = ScrollOrigin.from_element(canvas, *self.offset(x, y))
        ActionChains(self.driver).scroll_from_origin(origin, 0, delta).perform()

    def offset(self, x, y):
        """From the middle of the canvas, in pixels of the screen."""
        size = self.get("#canvas").size
        zoom = self.fitted()
        return round(x * zoom - size["width"] / 2), round(y * zoom - size["height"] / 2)

    def fitted(self):
        """The zoom at which all of the image is shown."""
        return self.run(
            "const canvas = document.getElementById('canvas');"
            "return canvas.clientWidth / canvas.firstChild.naturalWidth"
        )

    def drawn(self, y, x):
        """RGB in the middle of a pixel, where all of the image is shown."""
        return self.at(x + 0.5, y + 0.5)

    def at(self, x, y):
        """RGB at (x, y), in pixels of the image where all of it is shown."""
        return self.run(
            "const canvas = document.getElementById('canvas'), zoom = canvas.width / canvas.firstChild.naturalWidth;"
            "const one = new OffscreenCanvas(1, 1).getContext('2d');"
            "one.drawImage(canvas, -Math.floor(arguments[0] * zoom), -Math.floor(arguments[1] * zoom));"
            "return Array.from(one.getImageData(0, 0, 1, 1).data).slice(0, 3)",
            x,
            y,
        )

    def select(self, y, x):
        self.pointer(x + 0.5, y + 0.5).click().perform()
        self.settle()

    def table(self, id):
        """Text of the cells, row by row."""
        return self.run(
            "return Array.from(document.querySelectorAll(`#${arguments[0]} tbody tr`),"
            " row => Array.from(row.children, cell => cell.textContent))",
            id,
        )

    def text(self, selector):
        return self.get(selector).text

    def loaded(self):
        names = self.run("return performance.getEntriesByType('resource').map(entry => entry.name)")
        return [name for name in names if not name.startswith("data:")]

    def errors(self):
        return [entry["message"] for entry in self.driver.get_log("browser")]
