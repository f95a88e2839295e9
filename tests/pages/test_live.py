"""The live page in a real browser: its numbers are the package's; it works by mouse and
keyboard, without a network."""

import json
import re
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from browsers import offline
from numpy.testing import assert_allclose, assert_array_equal

from kfcourse import read_measurements
from kfcourse.lab import find_variant
from kfcourse.laws import normalised_square
from kfcourse.linear import smooth
from kfcourse.linear.consistency import innovations, nis
from kfcourse.pages import live
from kfcourse.scenarios import pointer

RECORDING = live.record(pointer.hand_track(seed=10), seed=6)
SECONDS = live.GRID * (len(RECORDING.position) - 1)
INTRODUCED = "300 in 5.99 s"  # of the recorded track, before anything is touched
START = {"interval": 20, "sigma": 8, "decibels": 57}
ALONE = (
    '<!doctype html><html lang="en"><head><meta '
    'charset="utf-8"><title>Live</title></head><body>{}</body></html>'
)


def system_of(interval: int, sigma: int, decibels: int):
    return pointer.uniform_acceleration(
        interval / 1000, np.sqrt(10 ** (decibels / 10) / (interval / 1000)), sigma
    )


def reference(
    interval: int,
    sigma: int,
    decibels: int,
    recording: live.Recording = RECORDING,
    last: float | None = None,
):
    """The page's table by the package: of the whole recording, or of its last seconds."""
    truth, y = recording.sampled(interval / 1000, sigma)
    system = system_of(interval, sigma, decibels)
    laws = pointer.follow(system, y, interval / 1000)
    error = laws.posterior.mean[:, 0, :2] - truth[3:]
    time = interval / 1000 * np.arange(3, len(truth))
    part = time > (-1 if last is None else time[-1] - last + 1e-9)
    size = normalised_square(error, laws.posterior.cov[:, 0, :2, :2])
    return {
        "noisy": np.sqrt(((y[3:, 0] - truth[3:])[part] ** 2).sum(axis=-1).mean()),
        "filtered": np.sqrt((error[part] ** 2).sum(axis=-1).mean()),
        "inside": 100 * np.mean(size[part] <= -2 * np.log(0.05)),
        "nis": nis(innovations(system.measure, laws.predicted, y[3:]))[part].mean(),
    }


def written(numbers: dict[str, float]) -> dict[str, str]:
    formats = {"noisy": "{:.2f} px", "filtered": "{:.2f} px", "inside": "{:.0f} %", "nis": "{:.2f}"}
    return {name: formats[name].format(value) for name, value in numbers.items()}


# ---------------------------------------------------------------- without a browser


def test_a_recording_is_the_track_and_its_noise():
    track = pointer.hand_track(seed=3, strokes=4)
    recording = live.record(track, seed=5)
    noisy = pointer.sample(track, live.GRID, 8.0, runs=1, seed=5)
    for every in (1, 4, 20):
        truth, y = recording.sampled(every * live.GRID, 8.0)
        # rounded to 0.001 px and 0.001 sigma: half of each, times 1 and 8
        assert_allclose(truth, noisy.state[::every, 0, :2], atol=0.5001e-3)
        assert_allclose(y, noisy.y[::every], atol=4.6e-3)
    assert_array_equal(recording.position, recording.position.round(3))


def test_an_interval_beside_the_grid_is_refused():
    with pytest.raises(ValueError, match=r"multiple of 0.01 s"):
        RECORDING.sampled(0.015, 8.0)


# ---------------------------------------------------------------- the browser


@contextmanager
def opening(browser, folder):
    """open_page(**options) -> page of a browser without network; time stands still but for
    page.clock.run_for(ms)."""
    with offline(browser) as new_tab:

        def open_page(**options):
            path, text = folder / "live.html", ALONE.format(live.page(RECORDING, **START))
            tab = new_tab(path, text, **({"viewport": {"width": 800, "height": 1000}} | options))
            tab.clock.install(time=0)
            tab.goto(path.as_uri())
            tab.clock.pause_at(1000)
            return tab

        yield open_page


@pytest.fixture
def opened(browser, tmp_path):
    with opening(browser, tmp_path) as open_page:
        yield open_page


@pytest.fixture(scope="module")
def script(browser, tmp_path_factory):
    """One page for all that only call its functions, which keep nothing."""
    with opening(browser, tmp_path_factory.mktemp("script")) as open_page:
        yield open_page()


def shown(tab, column: str = "all") -> dict[str, str]:
    return {
        name: tab.locator(f"[data-show={name}-{column}]").inner_text()
        for name in ("noisy", "filtered", "inside", "nis")
    }


def is_cleaner(tab) -> bool:
    noisy, filtered, *_ = (float(number.split()[0]) for number in shown(tab).values())
    return filtered < noisy


def text(tab, name: str) -> str:
    return tab.locator(f"[data-show={name}]").inner_text()


def status(tab) -> str:
    return tab.get_by_role("status").inner_text()


def press(tab, name: str) -> None:
    tab.get_by_role("button", name=name, exact=True).press("Enter")


def go_on(tab) -> None:
    """To the end of the recorded track."""
    for _ in range(round(10 * SECONDS) + 5):  # frames of 0.1 s, the longest steps it makes
        tab.clock.fast_forward(100)
    assert tab.get_by_role("button", name="Play again").is_visible()


def play_to_the_end(tab) -> None:
    press(tab, "Play the recorded track")
    go_on(tab)


def set_slider(tab, name: str, value: int) -> None:
    """By the keyboard, up or down from where it is."""
    slider = tab.locator(f"input[data-set={name}]")
    steps = (value - int(slider.input_value())) // live.SLIDERS[name].step
    for _ in range(abs(steps)):
        slider.press("ArrowRight" if steps > 0 else "ArrowLeft")
    assert slider.input_value() == str(value)


# ---------------------------------------------------------------- the filter of the page is the
# filter of the package


def page_s_run(tab, settings: dict) -> dict:
    """What the page's filter makes of the recording; as one text, which passes through Playwright
    faster than its numbers."""
    recording = {"position": RECORDING.position.tolist(), "noise": RECORDING.noise.tolist()}
    run = "text => JSON.stringify(kfcourseLive.run(...JSON.parse(text)))"
    return json.loads(tab.evaluate(run, json.dumps([recording, settings])))


@pytest.mark.parametrize(
    ("interval", "sigma", "decibels", "switches"),
    [
        (20, 8, 57, ()),
        (200, 1, 80, ()),
        (100, 8, 57, ("dropouts", "input")),
        (20, 8, 57, ("outliers", "gate")),
    ],
)
def test_the_filter_of_the_page_is_the_package_s(script, interval, sigma, decibels, switches):
    """What is lost or refused is a missing measurement to the package's filter; refused is what chi
    squared calls rare."""
    settings = {
        "interval": interval / 1000,
        "sigma": sigma,
        "intensity": 10 ** (decibels / 10),
    } | dict.fromkeys(switches, True)
    result = page_s_run(script, settings)
    samples, system, dt = result["samples"], system_of(interval, sigma, decibels), interval / 1000
    truth, clean = RECORDING.sampled(dt, sigma)
    assert_array_equal([sample["truth"] for sample in samples], truth)
    lost, refused = np.array(
        [[sample["y"] is None, sample.get("refused", False)] for sample in samples]
    ).T
    y = np.array([sample["y"] or [np.nan] * 2 for sample in samples])[:, None]
    wild = np.hypot(*(y - clean)[:, 0].T) > 1e-9  # a lost sample is not
    assert_allclose(np.hypot(*(y - clean)[wild, 0].T), 15 * sigma, rtol=1e-9)
    for marked, share in (
        (lost, 0.3 * ("dropouts" in switches)),
        (wild, 0.05 * ("outliers" in switches)),
    ):
        assert abs(marked.mean() - share) <= 4 * np.sqrt(share / len(y)) and not marked[:3].any()
    kept = np.where(refused[:, None, None], np.nan, y)
    u = np.nan_to_num(pointer.acceleration_from(y, dt)) if "input" in switches else None
    laws = pointer.follow(system, kept, dt, u)
    # Rounding of 1e-16 in each of some hundred steps, times Psi / R, which is sigma_a^2 Delta^4 /
    # (4 sigma^2) = 2e5 at the worst of these settings (200 ms, 1 px, 80 dB): there the covariance
    # is a small difference.
    for name, expected in (("law", laws.posterior), ("predicted", laws.predicted)):
        mean, cov = (
            np.array([sample[name][part] for sample in samples[3:]]) for part in ("mean", "cov")
        )
        sd = np.sqrt(np.diagonal(expected.cov[:, 0], axis1=1, axis2=2))
        assert np.max(np.abs(mean[..., 0] - expected.mean[:, 0]) / sd) < 1e-8
        assert np.max(np.abs(cov - expected.cov[:, 0]) / (sd[:, :, None] * sd[:, None, :])) < 1e-9
    for sample, p in zip(samples[3:], laws.posterior.cov[:, 0], strict=True):
        assert ("gain" in sample["law"]) == bool(sample["y"]) or sample.get("refused")
        if "gain" in sample["law"] and not sample.get("refused"):
            gain = p @ system.H.T / sigma**2
            assert_allclose(
                sample["law"]["gain"], gain, rtol=0, atol=1e-9 * np.sqrt(np.diag(p)).max() / sigma
            )
    size = nis(innovations(system.measure, laws.predicted, y[3:]))[:, 0]
    assert_array_equal(
        refused[3:], ("gate" in switches) & (np.nan_to_num(size) > -2 * np.log(0.001))
    )
    later = smooth(system, laws).mean[:, 0, :2]
    assert_allclose([sample["smoothed"] for sample in samples[3:]], later, rtol=1e-8, atol=1e-6)
    measures = result["measures"]
    assert measures["smoothed"] == pytest.approx(
        np.sqrt(((later - truth[3:]) ** 2).sum(axis=-1).mean()), rel=1e-8
    )
    if not switches:
        for name, value in reference(interval, sigma, decibels).items():
            assert measures[name] * (100 if name == "inside" else 1) == pytest.approx(
                value, rel=1e-9
            )


# ---------------------------------------------------------------- by keyboard


def test_the_recorded_track_by_keyboard(opened):
    tab = opened()
    focus = "document.activeElement.textContent + document.activeElement.tagName"
    order = []
    for _ in range(19):
        tab.keyboard.press("Tab")
        order.append(tab.evaluate(focus))
    assert [stop[-6:] for stop in order[:1]] == ["CANVAS"]
    buttons = ["Play the recorded track", "Step", "Clear", "CSV", "100 ms", "10 ms", "both"]
    assert order[1:] == [*(name + "BUTTON" for name in buttons), *["INPUT"] * 11]
    for _ in range(17):
        tab.keyboard.press("Shift+Tab")
    tab.keyboard.press("Enter")
    assert status(tab) == "Playing."
    tab.clock.run_for(2000)
    tab.keyboard.press("Space")
    count, seconds = re.fullmatch(r"(\d+) in (\d+\.\d\d) s", text(tab, "count")).groups()
    # frames of 16 ms; the first begins the track
    assert 1.9 < float(seconds) <= 2.0 and int(count) == int(float(seconds) / 0.02 + 1e-9) + 1
    part = live.Recording(
        *(values[: round(float(seconds) / live.GRID) + 1] for values in RECORDING)
    )
    assert shown(tab) == written(reference(**START, recording=part))
    assert status(tab) == "Paused at {} s: noisy {noisy}, filtered {filtered}.".format(
        seconds, **shown(tab)
    )
    tab.clock.run_for(1000)
    assert text(tab, "count") == f"{count} in {seconds} s"
    tab.keyboard.press("Enter")
    go_on(tab)
    assert shown(tab) == written(reference(**START))
    assert shown(tab, "recent") == written(reference(**START, last=3.0))
    assert shown(tab, "recent") != shown(tab)
    assert status(tab) == "End of the recorded track: noisy {noisy}, filtered {filtered}.".format(
        **shown(tab)
    )
    assert tab.evaluate(focus) == "Play againBUTTON"
    tab.keyboard.press("Enter")
    tab.clock.run_for(500)
    assert float(text(tab, "count").split()[2]) <= 0.5


def test_sliders_filter_the_same_track_anew(opened):
    tab = opened()
    play_to_the_end(tab)
    settings = {"interval": 100, "sigma": 9, "decibels": 41}
    for name, value in settings.items():
        set_slider(tab, name, value)
    assert shown(tab) == written(reference(**settings))
    assert text(tab, "interval") == "100 ms" and text(tab, "sigma") == "9 px"
    assert text(tab, "decibels") == "41 dB, 1.3·10⁴ px²/s³"
    tab.clock.run_for(1000)
    assert status(tab) == "At {:.2f} s: noisy {noisy}, filtered {filtered}.".format(
        SECONDS, **shown(tab)
    )
    for name, value in (("interval", "100 ms"), ("sigma", "9 px"), ("decibels", "41 decibels")):
        assert tab.locator(f"input[data-set={name}]").get_attribute("aria-valuetext") == value


# ---------------------------------------------------------------- switches, links, files


def check(tab, *names: str) -> None:
    for name in names:
        tab.locator(f"input[data-set={name}]").press("Space")
        assert tab.locator(f"input[data-set={name}]").is_checked()


def test_a_link_keeps_the_settings(opened):
    tab = opened()
    set_slider(tab, "decibels", 40)
    check(tab, "gate")
    tab.clock.run_for(500)
    assert tab.evaluate("location.hash") == "#live?decibels=40&gate=1"
    tab.evaluate("location.hash = '#live?sigma=17&outliers=1&interval=999'")
    tab.wait_for_function("document.querySelector('[data-show=sigma]').textContent === '17 px'")
    assert (
        tab.locator("input[data-set=outliers]").is_checked()
        and not tab.locator("input[data-set=gate]").is_checked()
    )
    assert text(tab, "interval") == "200 ms" and text(tab, "decibels").startswith("57 dB")


def test_its_file_is_a_record_of_the_chapter_s_model(opened, tmp_path):
    chapter = (Path(live.__file__).parents[2] / "book" / "beyond" / "live-track.md").read_text(
        encoding="utf-8"
    )
    (tmp_path / "pointer.toml").write_text(
        re.search(r"```toml\n(.*?)```", chapter, re.DOTALL)[1], encoding="utf-8"
    )
    tab = opened()
    play_to_the_end(tab)
    check(tab, "dropouts")
    with tab.expect_download() as download:
        press(tab, "CSV")
    download.value.save_as(tmp_path / "track.csv")
    assert download.value.suggested_filename == "track.csv"
    model = find_variant("pointer", tmp_path / "pointer.toml").model
    y = read_measurements(tmp_path / "track.csv", model).y
    assert len(y) == len(RECORDING.position[::2])
    assert status(tab).startswith(f"track.csv: {len(y)} samples")
    assert 0.25 < np.isnan(y).all(axis=-1).mean() < 0.35


# ---------------------------------------------------------------- by mouse


def circle(tab, move, seconds: float) -> None:
    """Move once round the middle of the field, at the rate of a screen."""
    box = tab.locator("canvas").bounding_box()
    for angle in np.linspace(0, 2 * np.pi, round(seconds / 0.016)):
        x = box["x"] + box["width"] / 2 + 0.3 * box["height"] * np.cos(angle)
        y = box["y"] + box["height"] / 2 + 0.3 * box["height"] * np.sin(angle)
        move(x, y)
        tab.clock.run_for(16)


def test_the_mouse_is_followed_and_its_track_cleaned(opened):
    tab = opened()
    tab.mouse.move(5, 5)
    assert text(tab, "count") == INTRODUCED
    circle(tab, tab.mouse.move, 2.0)  # a finger is followed alike, and does not scroll
    assert tab.locator("canvas").evaluate("e => getComputedStyle(e).touchAction") == "none"
    assert text(tab, "phase") == "ready" and status(tab) == "The filter is ready."
    tab.mouse.move(5, 5)
    count, seconds = re.fullmatch(r"(\d+) in (\d+\.\d\d) s", text(tab, "count")).groups()
    assert 1.9 < float(seconds) <= 2.0 and int(count) == int(float(seconds) / 0.02 + 1e-9) + 1
    assert status(tab) == "Your track, {} s: noisy {noisy}, filtered {filtered}.".format(
        seconds, **shown(tab)
    )
    assert is_cleaner(tab)
    tab.clock.run_for(2000)
    assert text(tab, "count") == f"{count} in {seconds} s"  # ended when the mouse left
    press(tab, "Clear")
    assert text(tab, "count") == "–"
