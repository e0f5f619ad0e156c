"""From a configuration to the trials of a study, each with a fingerprint of what determines its result."""
