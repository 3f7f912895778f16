"""One hit judged, several hits chosen, aligned and averaged."""
