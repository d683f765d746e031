"""Progress bars: drawn on a terminal, silent elsewhere."""

import sys

from deferred_ir.base.progress import progress_bar, track


def pretend_terminal(monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)


def test_without_a_terminal_only_printed_lines_appear(capsys):
    with progress_bar("work", 3, unit="frame", leave=True) as bar:
        bar.label("other work")
        bar.advance()
        bar.show(2, 3)
        bar.print("a line")
    assert list(track([1, 2], "items")) == [1, 2]
    assert capsys.readouterr() == ("a line\n", "")


def test_a_bar_shows_label_count_and_time_left(capsys, monkeypatch):
    pretend_terminal(monkeypatch)
    with progress_bar("work", 3, unit="frame", leave=True) as bar:
        for _ in range(3):
            bar.advance()
        bar.print("a line")
    output = capsys.readouterr()
    assert "a line" in output.out
    assert "work: 100 % |" in output.err
    assert "3/3 frames" in output.err
    assert "at most" not in output.err


def test_less_work_done_starts_the_bar_again(capsys, monkeypatch):
    pretend_terminal(monkeypatch)
    with progress_bar(leave=True) as bar:
        for done, total in ((5, 10), (10, 10), (2, 8), (4, 8)):
            bar.show(done, total)
    assert "50 % |" in capsys.readouterr().err


def test_work_that_may_end_early_shows_how_much_there_is_and_no_time_left(capsys, monkeypatch):
    pretend_terminal(monkeypatch)
    with progress_bar("peer", 90.0, leave=True, unit="second", at_most=True) as bar:
        bar.advance(12.3)
    assert "peer: 12 of at most 90 seconds |" in (err := capsys.readouterr().err)
    assert "left" not in err


def test_tracked_items_come_in_order(capsys, monkeypatch):
    pretend_terminal(monkeypatch)
    assert list(track(range(4), "items")) == [0, 1, 2, 3]
    assert "items:" in capsys.readouterr().err
