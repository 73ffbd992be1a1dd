"""The three published steps, and the steps that replace them where data are missing."""
