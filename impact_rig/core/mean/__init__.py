"""The mean of a sample's hits, and their series: outliers, trends, groups."""
