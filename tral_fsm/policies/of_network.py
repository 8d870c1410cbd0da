"""The policy that a network is."""

from __future__ import annotations

from tral_env.learned import LearnedPolicy, Network
from tral_fsm.policies.charted import ChartedPolicy
from tral_fsm.policies.corrected import CorrectedPolicy


def policy_of(network: Network) -> LearnedPolicy | CorrectedPolicy:
    """The policy that a network is: alone, with the machine that it corrects, or with the state chart that it follows.

    Raises:
        FormatError: the machine of the correction cannot run.
        ConfigError: the network was made for other estimates.
    """
    if network.correction is not None:
        return CorrectedPolicy(network, network.correction)
    return LearnedPolicy(network) if network.chart is None else ChartedPolicy(network)
