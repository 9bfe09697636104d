"""WAV files: channels of samples at a sampling rate, in parts of full scale or as floating-point numbers."""

import io
import math
import warnings

import numpy as np

from damping.errors import InputError
from damping.formats.arrays import Arrays
from damping.formats.headers import NAMES
from damping.formats.sampling import find_rows
from damping.formats.series import Samples, Stated


def read_wav(data: bytes, stated: Stated) -> Arrays:
    """The channels of a WAV file, named from 1, as far as the role ``response`` asks for them: (samples,), step in s.

    InputError: a broken or empty file, compressed samples, or no stated scale: a file does not say what full scale is.
    """
    from scipy.io import wavfile  # noqa: PLC0415 - half a second, for this format alone

    if "response" not in stated.scale:
        what = "a WAV file holds parts of full scale and does not say what that is"
        expected = "--scale response=VALUE_AT_FULL_SCALE --unit response=UNIT (1 if samples are in that unit)"
        raise InputError(what, expected=expected)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("error", category=wavfile.WavFileWarning)  # fewer samples than stated
            warnings.filterwarnings("ignore", "Chunk", wavfile.WavFileWarning)  # of text, which is skipped
            rate, table = wavfile.read(io.BytesIO(data))
    except UnboundLocalError:  # so SciPy answers a file without samples
        rate, table = 0, np.zeros(0)
    except Exception as error:  # whatever a damaged file makes the reader raise
        raise InputError(f"no WAV file that can be read ({error})", expected=NAMES["whole"]["wav"]) from None
    if not (rate and table.size):
        raise InputError("a WAV file without samples or sampling rate", expected=NAMES["whole"]["wav"])
    table = table.reshape(len(table), -1)
    known = {str(k + 1): (len(table),) for k in range(table.shape[1])}
    asked = stated.columns.get("response")
    chosen = [name for name in known if asked in (None, name)]
    whole = (-math.inf, math.inf)
    first, last = find_rows(stated.span or whole, 0.0, 1.0 / (stated.rate or rate), len(table))
    arrays: dict[str, list[Samples]] = {name: [_convert(table[first:last, int(name) - 1])] for name in chosen}
    return Arrays(arrays, {}, known, dict.fromkeys(known, (0.0, 1.0 / rate)), first)


def _convert(column: Samples) -> Samples:
    """Samples (n,) as they are, or integers over the largest; those of 8 bits are without a sign, 128 is zero."""
    if column.dtype.kind == "f":
        return column.astype(np.float64)
    if column.dtype == np.uint8:
        return (column.astype(np.float64) - 128.0) / 128.0
    return column / -float(np.iinfo(column.dtype).min)
