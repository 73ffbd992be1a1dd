"""The search for the missing effect: candidates, joint refits, scores on records left out, acceptance."""
