"""What a page may say: only what is declared, small, finite."""

import json

import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.integrations.live import messages


def test_a_request_keeps_its_number_and_values():
    asked = messages.parse('{"do": "stick", "rates_deg_s": [1, -2.5, 0], "n": 7}')
    assert isinstance(asked, messages.Stick)
    assert (asked.n, asked.rates_deg_s) == (7, (1.0, -2.5, 0.0))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "null",
        "not json",
        '{"do": "open", "path": "/etc/passwd"}',
        '{"do": "save", "out": "/tmp"}',
        '{"do": "stick", "rates_deg_s": [1, 2]}',
        '{"do": "stick", "rates_deg_s": [NaN, 0, 0]}',
        '{"do": "stick", "rates_deg_s": [1e9, 0, 0]}',
        '{"do": "speed", "times": 21}',
        '{"do": "speed", "times": 0}',
        '{"do": "fresh", "scenario": "../../etc/passwd"}',
        '{"do": "fresh", "scenario": "mine.yaml"}',
        '{"do": "break", "fault": {"type": "stuck", "actuator": {"a": 1}}}',
        '{"do": "break", "fault": {"a b": 1}}',
        '{"do": "pause", "on": true, "n": -1}',
    ],
)
def test_anything_else_is_refused_in_one_line(text):
    with pytest.raises(BadInput) as refused:
        messages.parse(text)
    assert "\n" not in str(refused.value)


def test_a_long_message_is_not_even_read():
    text = json.dumps({"do": "break", "fault": {"type": "x" * messages.MAX_BYTES}})
    with pytest.raises(BadInput, match="allowed: 2048"):
        messages.parse(text)
