"""The robust variant of the Heat Walk, `heatwalk.segment_robust`, one module per part."""
