"""The ids of the environments as parameters of tests."""

import pytest

from chmarl_pb.envs.registration import ENV_IDS

_GROUNDED = [env_id for env_id in ENV_IDS if "Grounded" in env_id]

#: Ids of the grounded track make a home before each episode: all but one of them are left to the slow suite.
EACH_ID = [pytest.param(env_id, marks=[pytest.mark.slow] * (env_id in _GROUNDED[:-1])) for env_id in ENV_IDS]
