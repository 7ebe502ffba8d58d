"""Where methods fail: towards singularities, over long times, on published benchmarks."""
