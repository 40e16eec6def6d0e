"""The page of a light stage: `relume view STAGE`."""
