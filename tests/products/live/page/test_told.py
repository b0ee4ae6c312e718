"""What a session tells of a flight, held whole: events, states and frames of scripted flights."""

import json

import pytest

import beaver_ftc as bf
from beaver_ftc.documents.errors import BadInput
from beaver_ftc_live.page import messages
from beaver_ftc_live.page.session import Session


def asked(session, **request):
    return session.handle(messages.parse(json.dumps(request)))


@pytest.fixture
def session(tmp_path):
    return Session(bf.load("fault-free"), tmp_path, seed=1)


def test_what_the_session_was_given_can_be_flown_again_and_files_cannot(session):
    given = bf.load({"name": "mine", "seed": 77})
    own = Session(given, session._out)
    asked(own, do="fresh", scenario="fault-free")
    assert own.hello()["scenario"] == "fault-free"
    assert "mine" in own.hello()["scenarios"]
    asked(own, do="fresh", scenario="mine", law="lqr")
    assert (own.scenario.seed, own.scenario.control.law, own.hello()["law"]) == (77, "lqr", "lqr")
    with pytest.raises(BadInput, match="scenario: 'fault-fre' is not known, did you mean fault-free"):
        asked(own, do="fresh", scenario="fault-fre")
