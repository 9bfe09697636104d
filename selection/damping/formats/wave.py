"""WAV files: channels of samples at a sampling rate, in parts of full scale or as floating-point numbers."""

import struct
from collections.abc import Sequence

import numpy as np

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.arrays import Arrays
from damping.formats.headers import NAMES
from damping.formats.series import Samples, Stated

_INTEGERS = 1  # format codes
_FLOATS = 3
_EXTENSIBLE = 0xFFFE  # the code stands further on
_UNTIL_END = 0xFFFFFFFF  # size of the samples in RF64, and in files of programs that did not know it in advance


def read_wav(data: bytes, stated: Stated) -> Arrays:
    """The channels of a WAV file, named from 1, as far as the role ``response`` asks for them.

    InputError: a broken file, compressed samples, or no stated scale: a file does not say what full scale is.
    """
    try:
        form, samples = _find_chunks(data)
        code, channels, rate, _, frame, bits = struct.unpack_from("<HHIIHH", form)
        code = struct.unpack_from("<H", form, 24)[0] if code == _EXTENSIBLE else code
    except struct.error:
        raise InputError("the file is cut off", expected=NAMES["whole"]["wav"]) from None
    if not (channels and rate and frame == channels * bits // 8 and (code, bits) in _FORMS):
        raise InputError(f"samples of format {code} with {bits} bits", expected=NAMES["whole"]["wav"])
    if "response" not in stated.scale:
        what = "a WAV file holds parts of full scale and does not say what that is"
        expected = "--scale response=VALUE_AT_FULL_SCALE --unit response=UNIT (1 if samples are in that unit)"
        raise InputError(what, expected=expected)
    count = len(samples) // frame
    known: dict[str, tuple[int, ...]] = {str(k + 1): (count,) for k in range(channels)}
    asked = stated.columns.get("response")
    table = np.frombuffer(samples, dtype=np.uint8, count=count * frame).reshape(count, channels, bits // 8)
    chosen: Sequence[str] = [name for name in known if asked in (None, name)]
    arrays: dict[str, list[Samples]] = {name: [_convert(table[:, int(name) - 1], code, bits)] for name in chosen}
    return Arrays(arrays, {}, known, dict.fromkeys(known, (0.0, 1.0 / rate)))


_FORMS = {(_INTEGERS, 8), (_INTEGERS, 16), (_INTEGERS, 24), (_INTEGERS, 32), (_FLOATS, 32), (_FLOATS, 64)}


def _find_chunks(data: bytes) -> tuple[bytes, memoryview]:
    """The description of the samples and the samples. struct.error: a file without them."""
    place, form = 12, b""
    while True:
        name, size = struct.unpack_from("<4sI", data, place)
        place += 8
        if name == b"data":
            size = len(data) - place if size == _UNTIL_END else size
            if size > len(data) - place:
                raise struct.error
            return form, memoryview(data)[place : place + size]
        form = data[place : place + size] if name == b"fmt " else form
        place += size + size % 2


def _convert(column: np.ndarray, code: int, bits: int) -> FloatArray:
    """Samples (n,) from bytes (n, bits/8): as they are, or integers over the largest."""
    if code == _FLOATS:
        return np.ascontiguousarray(column).view(f"<f{bits // 8}")[:, 0].astype(np.float64)
    wide = np.zeros((len(column), 4), dtype=np.uint8)  # the highest bytes of integers of 32 bits
    wide[:, 4 - bits // 8 :] = column
    if bits == 8:
        wide[:, 3] ^= 0x80  # alone without a sign: 128 is zero
    return wide.view("<i4")[:, 0] / 2.0**31
