"""The sensor: noise of the stated size, saturation, gamma and quantisation, against values worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from camcal.synthesis.scenario import Sensor
from camcal.synthesis.sensor import expose

SHAPE = (400, 500)
COUNT = SHAPE[0] * SHAPE[1]


def quiet(**settings) -> Sensor:
    """A sensor without noise."""
    return Sensor(**{"read_noise_levels": 0.0, "full_well_electrons": 0.0, **settings})


def recorded(signal, sensor, seed=3):
    """An exposure of an evenly lit field (or of the given signal)."""
    return expose(np.broadcast_to(np.asarray(signal, dtype=float), SHAPE), sensor, np.random.default_rng(seed))


def assert_spread(levels, expected):
    """A standard deviation within four of its own: sigma / sqrt(2 N)."""
    assert levels.std() == pytest.approx(expected, abs=4 * expected / np.sqrt(2 * COUNT))


def test_read_noise_is_in_8_bit_levels():
    """Two levels of read noise and the rounding's 1/12 add up; the mean stays."""
    image = recorded(0.5, quiet(read_noise_levels=2.0))
    assert_spread(image.astype(float), np.sqrt(4 + 1 / 12))
    assert image.mean() == pytest.approx(127.5, abs=4 * 2.02 / np.sqrt(COUNT))


def test_read_noise_at_16_bits_is_the_same_light():
    """Two 8-bit levels are 514 of 65535."""
    assert_spread(recorded(0.5, quiet(read_noise_levels=2.0, bits=16)).astype(float), 514.0)


@pytest.mark.parametrize("full_well", [100.0, 10000.0])
def test_shot_noise_grows_with_the_root_of_the_light(full_well):
    """The variance is the light over the full well, however many electrons there are."""
    for light in (0.1, 0.6):
        image = recorded(light, quiet(full_well_electrons=full_well, bits=16)) / 65535
        # Of few electrons some overshoot full scale and are clipped: 6 standard deviations at 0.6 of 100 are 5 away.
        assert_spread(image, np.sqrt(light / full_well))
        assert image.mean() == pytest.approx(light, abs=4 * np.sqrt(light / full_well / COUNT))


def test_few_electrons_are_counted_whole():
    """With a full well of 51 every value is a multiple of 5 levels of 255."""
    image = recorded(0.4, quiet(full_well_electrons=51.0))
    assert set(np.unique(image) % 5) == {0}


def test_shot_and_read_noise_are_independent():
    """Their variances add."""
    sensor = quiet(read_noise_levels=3.0, full_well_electrons=5000.0, bits=16)
    assert_spread(recorded(0.5, sensor) / 257, np.sqrt(9 + 255**2 * 0.5 / 5000))


def test_light_beyond_full_scale_saturates():
    """Above 1 is the top level, below 0 the bottom one, at either depth."""
    signal = np.broadcast_to(np.linspace(-0.2, 1.4, SHAPE[1]), SHAPE)
    for bits, top in ((8, 255), (16, 65535)):
        image = recorded(signal, quiet(bits=bits))
        assert (image[signal >= 1] == top).all()
        assert (image[signal <= 0] == 0).all()
    noisy = recorded(1.0, quiet(read_noise_levels=4.0))
    # Half of the noise is cut off.
    assert (noisy == 255).mean() == pytest.approx(0.5 + 0.5 * 0.0995, abs=0.01)


def test_noise_comes_before_gamma():
    """A gamma encoding stretches the noise by its own slope, 1 / gamma x light ** (1 / gamma - 1)."""
    light, gamma = 0.25, 2.2
    image = recorded(light, quiet(read_noise_levels=0.5, gamma=gamma, bits=16)) / 65535
    assert_spread(image, 0.5 / 255 / gamma * light ** (1 / gamma - 1))
    assert recorded(light, quiet(gamma=gamma))[0, 0] == round(255 * 0.25 ** (1 / 2.2))


def test_quantisation_rounds_to_the_nearest_level():
    """100.4 and 100.6 of 255 are 100 and 101; depth and type follow the bits."""
    assert recorded(100.4 / 255, quiet())[0, 0] == 100
    assert recorded(100.6 / 255, quiet())[0, 0] == 101
    assert recorded(0.5, quiet()).dtype == np.uint8
    deep = recorded(0.3, quiet(bits=16))
    assert deep.dtype == np.uint16
    assert deep[0, 0] == round(0.3 * 65535)


def test_other_depths_are_refused():
    """There are no 12-bit files."""
    with pytest.raises(ValueError, match="bits"):
        recorded(0.5, quiet(bits=12))


def test_the_signal_is_left_as_it_is():
    """Exposing does not change the light it is given."""
    signal = np.full(SHAPE, 0.5)
    expose(signal, Sensor(full_well_electrons=3000.0, gamma=2.2), np.random.default_rng(0))
    assert (signal == 0.5).all()
