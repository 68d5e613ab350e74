"""The noise of a run, drawn inside compiled loops: numpy's own stream (PCG64 seeded by SeedSequence, ziggurat), bit for bit.

For compiled kernels only; the slow twin is `numpy.random.default_rng([seed, stream]).standard_normal`, of which it takes a
quarter of the time: no call per number, and none of its branches is a toss of a coin.
"""

from __future__ import annotations

from math import exp, log1p

import numpy as np
from numba.np.random._constants import fi_double, ki_double, wi_double, ziggurat_nor_inv_r, ziggurat_nor_r

from detectors.compiled import high_product

# O'Neill (2014), PCG: multiplier of the 128-bit generator; Marsaglia and Tsang (2000): the ziggurat's layers
_LOW, _HIGH = np.uint64(4865540595714422341), np.uint64(2549297995355413924)
_BELOW, _HEIGHT = np.array(ki_double, dtype=np.uint64), np.array(fi_double)
# bit 8 of a random word is the sign: the second half of the widths is negative
_WIDTH = np.concatenate([wi_double, -np.array(wi_double)])
_TAIL, _TAIL_INVERSE = float(ziggurat_nor_r), float(ziggurat_nor_inv_r)
_ONE, _LAYER, _SIGNED, _MANTISSA = np.uint64(1), np.uint64(255), np.uint64(511), np.uint64(0x000FFFFFFFFFFFFF)
_U8, _U9, _U11, _U58, _U63, _U64 = (np.uint64(n) for n in (8, 9, 11, 58, 63, 64))
_MASK, _U16, _U32 = np.uint64(0xFFFFFFFF), np.uint64(16), np.uint64(32)


def draw(seeds, std, counts, out):
    """Add each lane's noise to its column of `out`: the first `counts` numbers of standard deviation `std`."""
    for lane in range(0, seeds.size, 2):
        a, b = lane, lane + 1
        a_high, a_low, a_step_high, a_step_low = _seeded(seeds[a], np.uint64(0))
        b_high, b_low, b_step_high, b_step_low = _seeded(seeds[b], np.uint64(0))
        a_count = counts[a] if std[a] > 0.0 else 0
        b_count = counts[b] if std[b] > 0.0 else 0
        both = min(a_count, b_count)
        # two generators in turn: one multiplies while the other waits for its product
        for k in range(both):
            x, a_high, a_low = _next_normal(a_high, a_low, a_step_high, a_step_low)
            y, b_high, b_low = _next_normal(b_high, b_low, b_step_high, b_step_low)
            out[k, a] += std[a] * x
            out[k, b] += std[b] * y
        for k in range(both, a_count):
            x, a_high, a_low = _next_normal(a_high, a_low, a_step_high, a_step_low)
            out[k, a] += std[a] * x
        for k in range(both, b_count):
            y, b_high, b_low = _next_normal(b_high, b_low, b_step_high, b_step_low)
            out[k, b] += std[b] * y


def _seeded(seed, stream):
    """Return the generator (state high, low, increment high, low) of `numpy.random.default_rng([seed, stream])`.

    `seed` below 2**64, `stream` below 2**32. O'Neill's seed_seq as numpy has it: four words of 32 bits, mixed.
    """
    a, hashed = np.uint64(0x43B0D7E5), np.uint64(0x8B51F9DD)
    long = seed > _MASK
    p0, a = _hashed(seed & _MASK, a, np.uint64(0x931E8875))
    p1, a = _hashed(seed >> _U32 if long else stream, a, np.uint64(0x931E8875))
    p2, a = _hashed(stream if long else np.uint64(0), a, np.uint64(0x931E8875))
    p3, a = _hashed(np.uint64(0), a, np.uint64(0x931E8875))
    for source in range(4):
        for target in range(4):
            if source != target:
                mixed, a = _hashed(_chosen(source, p0, p1, p2, p3), a, np.uint64(0x931E8875))
                mixed = np.uint64(0xCA01F9DD) * _chosen(target, p0, p1, p2, p3) - np.uint64(0x4973F715) * mixed
                mixed = mixed & _MASK
                mixed = mixed ^ (mixed >> _U16)
                p0 = mixed if target == 0 else p0
                p1 = mixed if target == 1 else p1
                p2 = mixed if target == 2 else p2
                p3 = mixed if target == 3 else p3
    w0, hashed = _hashed(p0, hashed, np.uint64(0x58F38DED))
    w1, hashed = _hashed(p1, hashed, np.uint64(0x58F38DED))
    w2, hashed = _hashed(p2, hashed, np.uint64(0x58F38DED))
    w3, hashed = _hashed(p3, hashed, np.uint64(0x58F38DED))
    w4, hashed = _hashed(p0, hashed, np.uint64(0x58F38DED))
    w5, hashed = _hashed(p1, hashed, np.uint64(0x58F38DED))
    w6, hashed = _hashed(p2, hashed, np.uint64(0x58F38DED))
    w7, hashed = _hashed(p3, hashed, np.uint64(0x58F38DED))
    start_high, start_low = w0 | (w1 << _U32), w2 | (w3 << _U32)
    way_high, way_low = w4 | (w5 << _U32), w6 | (w7 << _U32)
    step_high, step_low = (way_high << _ONE) | (way_low >> _U63), (way_low << _ONE) | _ONE
    # from zero one step, then the start, then another
    low = step_low + start_low
    high = step_high + start_high + (_ONE if low < step_low else np.uint64(0))
    high, low = _advanced(high, low, step_high, step_low)
    return high, low, step_high, step_low


def _hashed(value, constant, factor):
    """Return a hashed word and the next constant."""
    value = value ^ constant
    constant = (constant * factor) & _MASK
    value = (value * constant) & _MASK
    return value ^ (value >> _U16), constant


def _chosen(i, p0, p1, p2, p3):
    return p0 if i == 0 else p1 if i == 1 else p2 if i == 2 else p3


def _advanced(high, low, step_high, step_low):
    """Return the 128-bit state after one step of the generator."""
    next_low = low * _LOW + step_low
    carry = _ONE if next_low < step_low else np.uint64(0)
    return high * _LOW + (high_product(low, _LOW) + low * _HIGH + step_high + carry), next_low


def word(high, low):
    """Return the 64 random bits of a state."""
    mixed, turn = high ^ low, high >> _U58
    return (mixed >> turn) | (mixed << ((_U64 - turn) & _U63))


def uniform(bits):
    """Return a number in 0..1 from 64 random bits."""
    return np.float64(np.int64(bits >> _U11)) * (1.0 / 9007199254740992.0)


def _next_normal(high, low, step_high, step_low):
    """Return the next standard normal number, and the state of the generator behind it."""
    high, low = _advanced(high, low, step_high, step_low)
    bits = word(high, low)
    size = (bits >> _U9) & _MANTISSA
    x = np.float64(np.int64(size)) * _WIDTH[bits & _SIGNED]
    if size < _BELOW[bits & _LAYER]:
        return x, high, low  # 99 of 100
    return _rare_normal(bits, high, low, step_high, step_low)


def _rare_normal(bits, high, low, step_high, step_low):
    """Return the standard normal number that begins with these 64 bits, and the state of the generator behind it."""
    while True:
        layer, size = bits & _LAYER, (bits >> _U9) & _MANTISSA
        x = np.float64(np.int64(size)) * _WIDTH[bits & _SIGNED]
        if size < _BELOW[layer]:
            return x, high, low
        if layer == 0:
            while True:
                high, low = _advanced(high, low, step_high, step_low)
                beyond = -_TAIL_INVERSE * log1p(-uniform(word(high, low)))
                high, low = _advanced(high, low, step_high, step_low)
                y = -log1p(-uniform(word(high, low)))
                if y + y > beyond * beyond:
                    x = _TAIL + beyond
                    return (-x if (size >> _U8) & _ONE else x), high, low
        high, low = _advanced(high, low, step_high, step_low)
        if (_HEIGHT[layer - _ONE] - _HEIGHT[layer]) * uniform(word(high, low)) + _HEIGHT[layer] < exp(-0.5 * x * x):
            return x, high, low
        high, low = _advanced(high, low, step_high, step_low)
        bits = word(high, low)
