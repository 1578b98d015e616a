"""An experiment and the road from its recording to a comparison."""
