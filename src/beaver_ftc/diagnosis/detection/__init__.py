"""Is something wrong? The worst-case filters and their thresholds; the likelihood ratios beside them."""
