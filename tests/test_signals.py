from __future__ import annotations

import os
import signal
import threading

import pytest

from csm._signals import Stopped, Terminated, exit_status, saying, terminable


def send_terminate() -> None:
    os.kill(os.getpid(), signal.SIGTERM)


def test_sigterm_is_raised_in_the_block_and_the_handler_is_given_back():
    mine = []
    before = signal.signal(signal.SIGTERM, lambda *_: mine.append("old"))
    try:
        with pytest.raises(Terminated), terminable():
            send_terminate()
        assert mine == []
        send_terminate()
        assert mine == ["old"]
    finally:
        signal.signal(signal.SIGTERM, before)


def test_blocks_in_other_threads_leave_signals_alone():
    found = []

    def work() -> None:
        with terminable():
            found.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == [signal.getsignal(signal.SIGTERM)]


@pytest.mark.parametrize(
    ("raised", "kind", "status"), [(KeyboardInterrupt, Stopped, 130), (Terminated, Terminated, 143)]
)
def test_a_stop_says_what_is_kept(raised, kind, status):
    with pytest.raises(kind) as caught, saying(lambda: "outer"), saying(lambda: "2 of 3 shapes are kept"):
        raise raised
    assert caught.value.args == ("2 of 3 shapes are kept",)
    assert exit_status(caught.value) == status


def test_other_errors_pass():
    with pytest.raises(ValueError, match="mine"), saying(lambda: "not this"):
        raise ValueError("mine")
