"""State machines that drive: definition, states, transitions, policy."""
