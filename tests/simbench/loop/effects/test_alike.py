"""Groups that cannot be distinguished are mutual, and follow from record and baseline."""

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from simbench.loop.effects import EFFECTS
from simbench.loop.effects._alike import Circumstances, indistinguishable

BARE = Circumstances(sp_moves=True)


def alike(effect, **here):
    return set(indistinguishable(effect, replace(BARE, **here)))


def test_stiction_and_deadband_look_alike_when_op_jitters_by_more_than_j():
    assert alike("stiction", J=0.5, op_jitter=0.6) == {"stiction", "deadband"}
    assert alike("stiction", J=0.5, op_jitter=0.4) == {"stiction"}
    assert alike("stiction", J=None, op_jitter=9.0) == {"stiction"}
    assert alike("stiction", J=0.5, op_jitter=0.6, mv=True) == {"stiction"}


@given(
    st.sampled_from(sorted(EFFECTS)),
    st.sampled_from(sorted(EFFECTS)),
    st.builds(
        Circumstances,
        *[st.booleans()] * 4,
        op_jitter=st.floats(0, 5),
        J=st.none() | st.floats(0, 5),
        slow=st.booleans(),
        ramp=st.booleans(),
    ),
)
def test_looking_alike_is_mutual_and_includes_oneself(a, b, facts):
    assert a in indistinguishable(a, facts)
    assert (b in indistinguishable(a, facts)) == (a in indistinguishable(b, facts))
